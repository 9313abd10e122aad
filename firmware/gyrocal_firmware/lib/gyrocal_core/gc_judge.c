#include "gc_judge.h"

#include <math.h>

/* A larger scale or bias than this means a wrong rate, face or unit, not a working sensor. Chosen by judgement: 15 times the
   datasheet's 1 % of scale tolerance, and 50 times its 1 dps of zero-rate level. */
#define LARGEST_SCALE 0.15
#define LARGEST_BIAS_DPS 50.0
/* A sensor is reversed if it follows the rate with less than minus this fraction, by so many standard errors. Misalignment
   makes an axis across the table's follow the rate by a smaller fraction of either sign. */
#define OPPOSITE 0.1
#define OPPOSITE_ERRORS 5.0
/* A reading stands still if it does not change for this long and over this many samples, although its noise exceeds half a
   count. Chosen by judgement: with noise of half a count, a rate in the middle of a count gives that count with a probability of
   0.68, and 40 times in a row with 2e-7. */
#define STILL_US 500000u
#define STILL_SAMPLES 40u
/* Successive differences of white noise have a kurtosis of 3, with a standard deviation of 0.4 at 2 s; one reading of 249 dps
   in 870 of noise has 430. The limit lies 12 standard deviations above noise. */
#define KURTOSIS_LIMIT 8.0
/* Noise below one count has sparse differences, whose kurtosis is large by itself. Therefore the kurtosis counts only where one
   difference has at least this many counts. Chosen by judgement. */
#define KURTOSIS_COUNTS 8

static bool stands_still(const gc_run_t *run) {
    const double white_sd_dps = run->lsb_dps * sqrt(gc_baseline_white_variance(&run->baseline.total));
    const double expected_dps = white_sd_dps > 0.0 ? white_sd_dps : run->part->noise_dps;
    const bool long_still = run->still_longest_us >= STILL_US && run->still_longest >= STILL_SAMPLES;
    return run->n > 1u && expected_dps > 0.5 * run->lsb_dps && (run->bits.changes == 0u || long_still);
}

static bool has_spike(const gc_run_t *run) {
    const double sq = (double)run->baseline.total.sum_sq_diff;
    const double sum_diff4 = 18446744073709551616.0 * (double)run->sum_diff4[1] + (double)run->sum_diff4[0];
    return run->largest_diff >= KURTOSIS_COUNTS && sum_diff4 * (double)(run->n - 1u) > KURTOSIS_LIMIT * sq * sq;
}

uint32_t gc_judge_run(const gc_run_t *run) {
    uint32_t flags = 0;
    flags |= run->clipped > 0u ? GC_FLAG_CLIPPED : 0u;
    flags |= run->missed > 0u ? GC_FLAG_MISSED : 0u;
    flags |= run->opposed || gc_run_face_is_wrong(run) ? GC_FLAG_DIRECTION : 0u;
    flags |= stands_still(run) ? GC_FLAG_CONSTANT_READING : 0u;
    flags |= has_spike(run) || gc_run_has_stuck_bit(run) ? GC_FLAG_MISFIT : 0u;
    return flags;
}

/* NaN: no scale, and no direction. */
static bool is_opposite(const gc_answer_t *answer) {
    const double follows = 1.0 + answer->scale;
    return follows < -OPPOSITE && !(follows >= -OPPOSITE_ERRORS * answer->scale_se);
}

uint32_t gc_judge_answer(const gc_answer_t *answer, double blocks) {
    uint32_t flags = 0;
    const bool has_scale = answer->scale == answer->scale;
    const bool plausible = (!has_scale || fabs(answer->scale) <= LARGEST_SCALE) && fabs(answer->bias_dps) <= LARGEST_BIAS_DPS;
    flags |= plausible ? 0u : GC_FLAG_IMPLAUSIBLE;
    flags |= is_opposite(answer) ? GC_FLAG_DIRECTION : 0u;
    flags |= answer->misfit <= GC_MISFIT_LIMIT(blocks) ? 0u : GC_FLAG_MISFIT;
    return flags;
}
