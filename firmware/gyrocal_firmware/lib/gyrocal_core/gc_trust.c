#include "gc_trust.h"

#include "gc_error.h"
#include "gc_judge.h"
#include "gc_math.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define BLOCK_S (1e-6 * GC_BLOCK_US)
#define RADIANS_A_DEGREE 0.017453292519943295
/* Standard deviation (dps) and time constant (s) of the drift, chosen for sensors with a bias instability of up to 3 deg/h. That is
   the largest Allan deviation of a drift of 1.35 mdps; half of it errs least between none and that.
   `gyrocal benchmark population` measures what follows from the sizes here. */
#define DRIFT_SD_DPS 0.0007
#define DRIFT_TAU_S 30.0
/* Amplitude of the table's ripple, once or twice a turn, as a fraction of its rate. Typical are 0.0005 to 0.005; this is near
   their geometric mean. */
#define RIPPLE 0.0018
/* Size (dps) of the sensor's own transient after power-on: within the typical 5 to 50 mdps. */
#define WARMUP_DPS 0.02
/* The prior probability that an effect acts: a table in order, on which one in ten has it at a typical size. */
#define PRESENT 0.1
/* The least noise (dps) that is assumed of a reading. It only keeps divisions finite. */
#define SMALLEST_SD_DPS 1e-6
/* A network's answer disagrees if its expected error, by the fit of the effects, exceeds the stated standard error by
   this factor. None of 2000 sound sensors lies above it (`gyrocal benchmark population`). */
#define DISAGREES 4.5
/* Blocks that one part of the work whitens. Small enough for the time between two samples (docs/cpus.md). */
#define WHITENED 8u
/* Parts of the work for one face: its blocks are whitened, then two halves of the hypotheses are weighed. */
#define FACE_PARTS (GC_FACE_BLOCKS / WHITENED + 2u)

/* Sizes of the table's spin-up, as fractions of its rate. Typical are 0.0005 to 0.01; two sizes cover that range. */
static const double spin_up[] = {0.0009, 0.0065};
/* Time constants (s) of a transient, in steps of a factor 1.9: from a few blocks to longer than the 6 s of a run. */
static const double transient_tau_s[GC_TRANSIENT_TAUS] = {0.6, 1.15, 2.2, 4.2, 8.0};

#define SIZES (sizeof spin_up / sizeof spin_up[0])
#define TAUS GC_TRANSIENT_TAUS

/* The columns of a block are four waves, a decay for each time constant, the constant 1, and the reading. */
#define WAVES 4u
#define ONE (WAVES + TAUS)
#define Y (ONE + 1u)
#define COLUMNS GC_EVIDENCE_COLUMNS

typedef double gram_t[COLUMNS][COLUMNS]; /* only the lower triangle is used */

typedef char gc_columns_fit[Y + 1u == COLUMNS ? 1 : -1];

static void begin_shapes(gc_shapes_t *s, double w_dps) {
    const double angle = RADIANS_A_DEGREE * fabs(w_dps) * BLOCK_S;
    gc_cos_sin(0.5 * angle, &s->cosine, &s->sine);
    gc_cos_sin(angle, &s->cosine_step, &s->sine_step);
    for (size_t i = 0; i < TAUS; i++) {
        s->decay[i] = gc_decay(0.5 * BLOCK_S / transient_tau_s[i]);
        s->decay_step[i] = s->decay[i] * s->decay[i];
    }
    s->ripple_dps = RIPPLE * fabs(w_dps) / sqrt(2.0);
}

static void next_shapes(gc_shapes_t *s) {
    const double cosine = s->cosine * s->cosine_step - s->sine * s->sine_step;
    s->sine = s->sine * s->cosine_step + s->cosine * s->sine_step;
    s->cosine = cosine;
    for (size_t i = 0; i < TAUS; i++) {
        s->decay[i] *= s->decay_step[i];
    }
}

static void columns_of(const gc_shapes_t *s, double y_dps, double *x) {
    const double twice = 2.0 * s->ripple_dps * s->cosine;
    x[0] = s->ripple_dps * s->cosine;
    x[1] = s->ripple_dps * s->sine;
    x[2] = twice * s->cosine - s->ripple_dps;
    x[3] = twice * s->sine;
    for (size_t i = 0; i < TAUS; i++) {
        x[WAVES + i] = s->decay[i];
    }
    x[ONE] = 1.0;
    x[Y] = y_dps;
}

/* The variance of rounding that no mean reduces, if the noise is too small to average over the reading's steps. */
static double standing_of(const gc_evidence_t *evidence) {
    const double step = evidence->lsb_dps * evidence->lsb_dps;
    return 4.0 * evidence->white_dps2 < step ? step / 12.0 : 0.0;
}

/* The variance of a sample's noise, which is at least that of rounding. */
static double noise_of(const gc_evidence_t *evidence) {
    const double lsb_dps = evidence->lsb_dps;
    return fmax(evidence->white_dps2, fmax(lsb_dps * lsb_dps / 12.0, SMALLEST_SD_DPS * SMALLEST_SD_DPS));
}

/* Adds blocks from `begin` on to C V^-1 C', where C holds the columns and V is the covariance of noise and drift. A Kalman filter
   of the drift whitens them. */
static void whiten(gc_evidence_t *evidence, gc_face_evidence_t *e, unsigned begin) {
    const gc_face_t *face = e->face;
    const double lsb_dps = evidence->lsb_dps;
    const double variance = noise_of(evidence);
    const double phi_step = gc_decay(BLOCK_S / DRIFT_TAU_S);
    const unsigned end = begin + WHITENED < evidence->seen ? begin + WHITENED : evidence->seen;
    gc_whitening_t *w = &evidence->whitening;
    if (begin == 0u) {
        memset(w, 0, sizeof *w);
        memset(&evidence->gram, 0, sizeof evidence->gram);
        begin_shapes(&w->shapes, e->w_dps);
        w->spread = DRIFT_SD_DPS * DRIFT_SD_DPS;
        w->phi = 1.0;
    }
    for (unsigned k = begin; k < end; k++, next_shapes(&w->shapes), w->phi *= phi_step) {
        if (!gc_face_has(face, k)) {
            continue;
        }
        const double n = (double)face->block[k].n;
        const double y_dps = lsb_dps * ((double)face->block[k].sum / n);
        if (!w->begun) {
            w->begun = true;
            w->origin_dps = y_dps;
        } else {
            for (size_t j = 0; j < COLUMNS; j++) {
                w->drift[j] *= w->phi;
            }
            w->spread = w->phi * w->phi * w->spread + DRIFT_SD_DPS * DRIFT_SD_DPS * (1.0 - w->phi * w->phi);
        }
        w->phi = 1.0;
        double x[COLUMNS];
        columns_of(&w->shapes, y_dps - w->origin_dps, x);
        const double precision = 1.0 / (w->spread + variance / n);
        for (size_t i = 0; i < COLUMNS; i++) {
            x[i] -= w->drift[i];
            w->drift[i] += w->spread * precision * x[i];
            const double weighted = precision * x[i];
            for (size_t j = 0; j <= i; j++) {
                evidence->gram[i][j] += weighted * x[j];
            }
        }
        w->spread *= variance / n * precision;
    }
    e->origin_dps = w->origin_dps + lsb_dps * face->origin - e->w_dps;
}

/* Integrates out wave j, whose prior is standard normal. Returns its factor of the determinant. */
static double eliminate(gram_t g, size_t j) {
    const double pivot = 1.0 + g[j][j];
    for (size_t i = j + 1u; i < COLUMNS; i++) {
        const double factor = g[i][j] / pivot;
        for (size_t k = j + 1u; k <= i; k++) {
            g[i][k] -= factor * g[k][j];
        }
    }
    return pivot;
}

/* Weighs one hypothesis, given the columns without the waves: a transient of `size` dps, or none for 0. */
static void weigh(gram_t g, double det, size_t decay, double size, double origin_dps, double standing, gc_hypothesis_t *h) {
    const size_t e = WAVES + decay;
    const double square = size * size;
    const double pivot = 1.0 + square * g[e][e];
    const double share = square / pivot;
    const double by_one = share * g[ONE][e], by_y = share * g[Y][e];
    const double one = g[ONE][ONE] - by_one * g[ONE][e];
    const double one_y = g[Y][ONE] - by_one * g[Y][e];
    const double y = g[Y][Y] - by_y * g[Y][e];
    const double variance = 1.0 / one;
    const double u_dps = one_y * variance;
    h->u_dps = u_dps + origin_dps;
    h->variance = variance + standing;
    h->chi2 = fmax(y - one_y * u_dps, 0.0);
    h->log_evidence = -0.5 * (h->chi2 + gc_log(det * pivot * one));
}

/* Weighs the half of the hypotheses that is without or with ripple twice a turn. */
static void weigh_all(const gc_evidence_t *evidence, gc_face_evidence_t *e, bool twice) {
    const double standing = standing_of(evidence);
    gc_hypothesis_t *h = e->hypothesis + (twice ? GC_FIRST_ORDER : 0u);
    for (unsigned waves = twice ? 2u : 0u; waves < (twice ? 4u : 2u); waves++) {
        gram_t left;
        double det = 1.0;
        memcpy(left, evidence->gram, sizeof left);
        for (size_t j = 0; j < WAVES; j++) {
            if ((waves & (1u << (j / 2u))) != 0u) {
                det *= eliminate(left, j);
            }
        }
        weigh(left, det, 0, 0.0, e->origin_dps, standing, h++);
        for (size_t i = 0; i < SIZES; i++) {
            const double size = sqrt(e->w_dps * e->w_dps * spin_up[i] * spin_up[i] + WARMUP_DPS * WARMUP_DPS);
            for (size_t k = 0; k < TAUS; k++) {
                weigh(left, det, k, size, e->origin_dps, standing, h++);
            }
        }
    }
}

int gc_evidence_begin(gc_evidence_t *evidence, const gc_face_t *a, const gc_face_t *b, unsigned blocks, double w_a_dps,
                      double w_b_dps, double lsb_dps) {
    const gc_face_t *const faces[] = {a, b};
    memset(evidence, 0, sizeof *evidence);
    evidence->seen = blocks;
    evidence->lsb_dps = lsb_dps;
    evidence->white_dps2 = lsb_dps * lsb_dps * gc_face_white_variance(a, b, blocks);
    for (unsigned i = 0; i < 2u; i++) {
        gc_face_evidence_t *e = &evidence->of[i];
        e->face = faces[i];
        e->w_dps = i == 0u ? w_a_dps : w_b_dps;
        for (unsigned k = 0; k < blocks; k++) {
            e->blocks += gc_face_has(e->face, k) ? 1u : 0u;
        }
    }
    if (w_a_dps == w_b_dps) {
        return GC_E_UNIDENTIFIED;
    }
    return evidence->of[0].blocks > 0u && evidence->of[1].blocks > 0u && evidence->white_dps2 >= 0.0 ? GC_OK : GC_E_TOO_SHORT;
}

/* ---- averages over hypotheses ---- */

typedef struct {
    double log_evidence;
    double mean;
    double variance;
} under_t;

/* The estimate of a face if some effects act: the average over n hypotheses. */
static under_t under(const gc_hypothesis_t *h, unsigned n) {
    double top = -DBL_MAX, total = 0.0, mean = 0.0, variance = 0.0;
    for (unsigned i = 0; i < n; i++) {
        top = fmax(top, h[i].log_evidence);
    }
    if (n == 1u) {
        return (under_t){top, h[0].u_dps, h[0].variance};
    }
    double weight[GC_TRANSIENTS];
    for (unsigned i = 0; i < n; i++) {
        weight[i] = gc_decay(top - h[i].log_evidence);
        total += weight[i];
        mean += weight[i] * h[i].u_dps;
    }
    mean /= total;
    for (unsigned i = 0; i < n; i++) {
        const double off = h[i].u_dps - mean;
        variance += weight[i] * (h[i].variance + off * off);
    }
    return (under_t){top + gc_log(total / (double)n), mean, variance / total};
}

/* Birge's ratio: the chi-square per degree of freedom of the likeliest hypothesis, or 1 if that is less. */
static double excess(const gc_face_evidence_t *e) {
    unsigned best = 0;
    for (unsigned i = 1; i < GC_HYPOTHESES; i++) {
        best = e->hypothesis[i].log_evidence > e->hypothesis[best].log_evidence ? i : best;
    }
    return fmax(1.0, e->hypothesis[best].chi2 / (e->blocks > 1u ? (double)(e->blocks - 1u) : 1.0));
}

/* Computes scale and bias for two of the eight combinations of effects. */
static void combine(gc_evidence_t *evidence, unsigned effects) {
    const gc_face_evidence_t *a = &evidence->of[0];
    const gc_face_evidence_t *b = &evidence->of[1];
    const double span = a->w_dps - b->w_dps;
    const double excess_a = excess(a), excess_b = excess(b);
    unsigned first = effects / 2u * (1u + GC_TRANSIENTS);
    for (unsigned last = effects + 2u; effects < last; effects++) {
        const unsigned n = effects % 2u == 0u ? 1u : GC_TRANSIENTS;
        const under_t u = under(a->hypothesis + first, n);
        const under_t v = under(b->hypothesis + first, n);
        const double var_u = u.variance * excess_a, var_v = v.variance * excess_b;
        const double acting = (double)((effects & 1u) + (effects >> 1 & 1u) + (effects >> 2 & 1u));
        evidence->each[effects] = (gc_combined_t){
            {(u.mean - v.mean) / span, (a->w_dps * v.mean - b->w_dps * u.mean) / span},
            {(var_u + var_v) / (span * span), (b->w_dps * b->w_dps * var_u + a->w_dps * a->w_dps * var_v) / (span * span)},
        };
        evidence->log_weight[effects] =
            u.log_evidence + v.log_evidence + acting * gc_log(PRESENT) + (3.0 - acting) * gc_log(1.0 - PRESENT);
        first += n;
    }
}

static void average(gc_evidence_t *evidence) {
    double weight[GC_EVIDENCE_EFFECTS];
    double top = -DBL_MAX, total = 0.0;
    gc_combined_t *all = &evidence->all;
    for (unsigned i = 0; i < GC_EVIDENCE_EFFECTS; i++) {
        top = fmax(top, evidence->log_weight[i]);
    }
    for (unsigned i = 0; i < GC_EVIDENCE_EFFECTS; i++) {
        weight[i] = gc_decay(top - evidence->log_weight[i]);
        total += weight[i];
    }
    memset(all, 0, sizeof *all);
    for (unsigned j = 0; j < 2u; j++) {
        for (unsigned i = 0; i < GC_EVIDENCE_EFFECTS; i++) {
            all->mean[j] += weight[i] / total * evidence->each[i].mean[j];
        }
        for (unsigned i = 0; i < GC_EVIDENCE_EFFECTS; i++) {
            const double off = evidence->each[i].mean[j] - all->mean[j];
            all->variance[j] += weight[i] / total * (evidence->each[i].variance[j] + off * off);
        }
    }
}

/* Holds the average against the last whole turn of the run that began first. A ripple cancels over a turn. A warm-up, or a table
   that settles, moves the readings, and with them what the second run shows. */
static double moved(const gc_evidence_t *evidence) {
    const gc_face_evidence_t *e = &evidence->of[evidence->of[0].face->first_us <= evidence->of[1].face->first_us ? 0 : 1];
    const gc_combined_t *all = &evidence->all;
    double mean = 0.0;
    const uint32_t n = gc_face_last_turn(e->face, (uint64_t)evidence->seen * GC_BLOCK_US, &mean);
    if (n == 0u) {
        return 0.0;
    }
    const double off_dps = evidence->lsb_dps * mean - e->w_dps - (all->mean[1] + all->mean[0] * e->w_dps);
    const double expected = all->variance[1] + e->w_dps * e->w_dps * all->variance[0];
    const double own = noise_of(evidence) / (double)n + standing_of(evidence) + DRIFT_SD_DPS * DRIFT_SD_DPS;
    return fabs(off_dps) / sqrt(expected + own);
}

bool gc_evidence_go_on(gc_evidence_t *evidence) {
    const unsigned part = evidence->parts++;
    if (part < 2u * FACE_PARTS) {
        gc_face_evidence_t *e = &evidence->of[part / FACE_PARTS];
        if (part % FACE_PARTS < FACE_PARTS - 2u) {
            whiten(evidence, e, part % FACE_PARTS * WHITENED);
        } else {
            weigh_all(evidence, e, part % FACE_PARTS == FACE_PARTS - 1u);
        }
    } else {
        combine(evidence, 2u * (part - 2u * FACE_PARTS));
    }
    if (evidence->parts < GC_EVIDENCE_PARTS) {
        return false;
    }
    average(evidence);
    evidence->moved = moved(evidence);
    return true;
}

/* Computes the square roots of an answer's expected squared errors. */
static void errors_of(const gc_evidence_t *evidence, const gc_answer_t *answer, double *scale_se, double *bias_se_dps) {
    const gc_combined_t *all = &evidence->all;
    const double scale_off = answer->scale - all->mean[0];
    const double bias_off = answer->bias_dps - all->mean[1];
    *scale_se = sqrt(all->variance[0] + scale_off * scale_off);
    *bias_se_dps = sqrt(all->variance[1] + bias_off * bias_off);
}

/* The misfit, which exceeds its limit by as many standard deviations as the readings moved if they moved too far. NaN stays NaN. */
static double held(const gc_evidence_t *evidence, double misfit) {
    const double least = 1.0 + evidence->moved / sqrt(2.0 * (double)(evidence->of[0].blocks + evidence->of[1].blocks));
    return evidence->moved > GC_MISFIT_ERRORS && misfit < least ? least : misfit;
}

void gc_evidence_errors(const gc_evidence_t *evidence, gc_answer_t *answer) {
    const double dof = (double)evidence->of[0].blocks + (double)evidence->of[1].blocks - 2.0;
    const double chi2 = evidence->of[0].hypothesis[0].chi2 + evidence->of[1].hypothesis[0].chi2;
    errors_of(evidence, answer, &answer->scale_se, &answer->bias_se_dps);
    answer->misfit = held(evidence, dof > 0.0 ? sqrt(chi2 / dof) : NAN);
}

/* The chi-square of a face's blocks about u_dps, under the hypothesis that is the likeliest for this u. */
static double chi2_at(const gc_face_evidence_t *e, double u_dps) {
    double best = -DBL_MAX, chi2 = 0.0;
    for (unsigned i = 0; i < GC_FIRST_ORDER; i++) {
        const gc_hypothesis_t *h = &e->hypothesis[i];
        const double off = u_dps - h->u_dps;
        const double more = off * off / h->variance;
        const double at = h->log_evidence - 0.5 * (more + gc_log(h->variance));
        if (at > best) {
            best = at;
            chi2 = h->chi2 + more;
        }
    }
    return chi2;
}


uint32_t gc_evidence_judge(const gc_evidence_t *evidence, bool known_table, gc_answer_t *answer) {
    const gc_face_evidence_t *of = evidence->of;
    double chi2 = 0.0;
    for (unsigned i = 0; i < 2u; i++) {
        chi2 += chi2_at(&of[i], answer->bias_dps + answer->scale * of[i].w_dps);
    }
    answer->misfit = sqrt(chi2 / (double)(of[0].blocks + of[1].blocks));
    double scale_se, bias_se_dps;
    errors_of(evidence, answer, &scale_se, &bias_se_dps);
    /* network paper has standard errors of NaN, for which this is false */
    const bool disagrees = scale_se > DISAGREES * answer->scale_se || bias_se_dps > DISAGREES * answer->bias_se_dps;
    if (!known_table) {
        const bool claims = answer->scale_se == answer->scale_se; /* network paper has none */
        answer->scale_se = claims ? scale_se : answer->scale_se;
        answer->bias_se_dps = claims ? bias_se_dps : answer->bias_se_dps;
        answer->misfit = held(evidence, answer->misfit);
    }
    return disagrees ? (uint32_t)GC_FLAG_DISAGREES : 0u;
}
