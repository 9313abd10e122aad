#include "gc_baseline.h"

#include "gc_error.h"

#include <math.h>
#include <string.h>

void gc_baseline_begin(gc_baseline_t *run, double rate_hz) {
    memset(run, 0, sizeof *run);
    run->rate_hz = rate_hz;
}

/* A block with fewer than half the samples it should have is left out. */
static void close_block(gc_baseline_t *run) {
    if (2.0 * 1e6 * (double)run->block_n >= run->rate_hz * GC_BLOCK_US) {
        gc_baseline_sums_t *total = &run->total;
        total->blocks++;
        total->block_samples += run->block_n;
        total->block_sum += run->block_sum;
        total->block_sum_sq += (double)run->block_sum * (double)run->block_sum / (double)run->block_n;
    }
    run->block_n = 0;
    run->block_sum = 0;
}

static void complete_checkpoints(gc_baseline_t *run, uint64_t reached_us) {
    while (run->checkpoints < GC_CHECKPOINTS && run->total.n > 0u && reached_us >= GC_CHECKPOINT_US(run->checkpoints)) {
        close_block(run); /* a checkpoint is always the edge of a block */
        run->at[run->checkpoints++] = run->total;
    }
}

void gc_baseline_advance(gc_baseline_t *run, uint64_t t_us) {
    if (run->total.n > 0u) {
        complete_checkpoints(run, t_us - run->first_us);
    }
}

void gc_baseline_add(gc_baseline_t *run, uint64_t t_us, int16_t count) {
    gc_baseline_sums_t *total = &run->total;
    if (total->n == 0u) {
        run->first_us = t_us;
        total->origin = count;
    } else {
        const int64_t diff = (int64_t)count - run->last;
        total->sum_sq_diff += diff * diff;
    }
    const uint64_t block = (t_us - run->first_us) / GC_BLOCK_US;
    if (block != run->block) {
        close_block(run);
        run->block = block;
    }
    run->block_n++;
    run->block_sum += (int64_t)count - total->origin;
    total->n++;
    total->sum += count;
    run->last = count;
    run->last_us = t_us;
}

void gc_baseline_end(gc_baseline_t *run) {
    if (run->total.n > 0u) {
        complete_checkpoints(run, run->last_us - run->first_us + (uint64_t)(1.5e6 / run->rate_hz));
        close_block(run);
    }
}

double gc_baseline_white_variance(const gc_baseline_sums_t *sums) {
    return sums->n < 2u ? NAN : (double)sums->sum_sq_diff / (2.0 * (double)(sums->n - 1u));
}

static double mean(const gc_baseline_sums_t *s) {
    return (double)s->sum / (double)s->n;
}

/* Sum over blocks of n_b (mean_b - mean)^2, in counts^2. */
static double scatter(const gc_baseline_sums_t *s) {
    const double m = (double)(s->sum - (int64_t)s->origin * s->n) / (double)s->n;
    return s->block_sum_sq - 2.0 * m * (double)s->block_sum + m * m * (double)s->block_samples;
}

static double misfit(const gc_baseline_sums_t *const *runs, unsigned n_runs) {
    double chi2 = 0.0;
    double dof = 0.0;
    for (unsigned i = 0; i < n_runs; i++) {
        const double white = gc_baseline_white_variance(runs[i]);
        if (!(white > 0.0)) {
            return NAN;
        }
        chi2 += scatter(runs[i]) / white;
        dof += (double)runs[i]->blocks - 1.0;
    }
    return dof > 0.0 ? sqrt(fmax(chi2, 0.0) / dof) : NAN;
}

int gc_baseline_solve(const gc_baseline_sums_t *a, const gc_baseline_sums_t *b, double w_a_dps, double w_b_dps,
                      double lsb_dps, gc_answer_t *answer) {
    if (a->n < 2u || b->n < 2u) {
        return GC_E_TOO_SHORT;
    }
    const double span = w_a_dps - w_b_dps;
    if (span == 0.0) {
        return GC_E_UNIDENTIFIED;
    }
    const double mean_a = lsb_dps * mean(a);
    const double mean_b = lsb_dps * mean(b);
    const double var_a = lsb_dps * lsb_dps * gc_baseline_white_variance(a) / (double)a->n;
    const double var_b = lsb_dps * lsb_dps * gc_baseline_white_variance(b) / (double)b->n;
    answer->scale = (mean_a - mean_b) / span - 1.0;
    answer->scale_se = sqrt(var_a + var_b) / fabs(span);
    answer->bias_dps = mean_a - (1.0 + answer->scale) * w_a_dps;
    answer->bias_se_dps = sqrt(w_b_dps * w_b_dps * var_a + w_a_dps * w_a_dps * var_b) / fabs(span);
    answer->misfit = misfit((const gc_baseline_sums_t *const[]){a, b}, 2);
    return GC_OK;
}

int gc_baseline_rest(const gc_baseline_sums_t *run, double lsb_dps, gc_answer_t *answer) {
    if (run->n < 2u) {
        return GC_E_TOO_SHORT;
    }
    answer->scale = NAN;
    answer->scale_se = NAN;
    answer->bias_dps = lsb_dps * mean(run);
    answer->bias_se_dps = lsb_dps * sqrt(gc_baseline_white_variance(run) / (double)run->n);
    answer->misfit = misfit(&run, 1);
    return GC_OK;
}
