#include "gc_trust.h"

#include "gc_error.h"
#include "gc_math.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define BLOCK_S (1e-6 * GC_BLOCK_US)
#define RADIANS_A_DEGREE 0.017453292519943295
#define DRIFT_SD_DPS 0.0023
#define DRIFT_TAU_S 30.0
#define RIPPLE 0.0018
#define WARMUP_DPS 0.02
#define PRESENT 0.5
#define SMALLEST_SD_DPS 1e-6
#define DISAGREES 3.5 /* expected error over the one that an answer claims */

#define TAUS GC_TRANSIENT_TAUS

static const double spin_up[] = {0.0011, 0.0047};
static const double transient_tau_s[TAUS] = {0.6, 1.15, 2.2, 4.2, 8.0};

#define SIZES (sizeof spin_up / sizeof spin_up[0])

/* Columns of a block: four waves, a decay for each time constant, 1, the reading. */
#define WAVES 4u
#define ONE (WAVES + TAUS)
#define Y (ONE + 1u)
#define COLUMNS GC_EVIDENCE_COLUMNS

typedef double gram_t[COLUMNS][COLUMNS]; /* its lower triangle */

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

static void begin_whitening(gc_evidence_t *evidence, const gc_face_evidence_t *e) {
    gc_whitener_t *w = &evidence->whitener;
    memset(evidence->gram, 0, sizeof evidence->gram);
    memset(w, 0, sizeof *w);
    w->spread = DRIFT_SD_DPS * DRIFT_SD_DPS;
    w->phi = 1.0;
    begin_shapes(&w->shapes, e->w_dps);
}

/* C V^-1 C' of the columns, V the covariance of noise and drift, by a Kalman filter of the drift: a part of the blocks. */
static void whiten(gc_evidence_t *evidence, gc_face_evidence_t *e, unsigned part) {
    const gc_face_t *face = e->face;
    const double lsb_dps = evidence->lsb_dps;
    const double step = lsb_dps * lsb_dps / 12.0;
    const double variance = fmax(evidence->white_dps2, fmax(step, SMALLEST_SD_DPS * SMALLEST_SD_DPS));
    const double phi_step = gc_decay(BLOCK_S / DRIFT_TAU_S);
    gram_t *gram = &evidence->gram;
    gc_whitener_t *w = &evidence->whitener;
    if (part == 0u) {
        begin_whitening(evidence, e);
    }
    const unsigned end = (part + 1u) * evidence->seen / GC_WHITEN_PARTS;
    for (unsigned k = part * evidence->seen / GC_WHITEN_PARTS; k < end; k++, next_shapes(&w->shapes), w->phi *= phi_step) {
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
                (*gram)[i][j] += weighted * x[j];
            }
        }
        w->spread *= variance / n * precision;
    }
    e->origin_dps = w->origin_dps + lsb_dps * face->origin - e->w_dps;
}

/* Integrates out wave j, whose prior is standard normal; returns the determinant's factor. */
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

/* One hypothesis from what is left after the waves: a transient of `size` dps, 0 = none. */
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

/* The hypotheses without or with ripple twice a turn. */
static void weigh_all(const gc_evidence_t *evidence, gc_face_evidence_t *e, bool twice) {
    const double step = evidence->lsb_dps * evidence->lsb_dps;
    const double standing = 4.0 * evidence->white_dps2 < step ? step / 12.0 : 0.0;
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

/* What a face says if some effects act: hypotheses first to first + n - 1. */
static gc_under_t under(const gc_hypothesis_t *h, unsigned n) {
    double top = -DBL_MAX, total = 0.0, mean = 0.0, variance = 0.0;
    for (unsigned i = 0; i < n; i++) {
        top = fmax(top, h[i].log_evidence);
    }
    if (n == 1u) {
        return (gc_under_t){top, h[0].u_dps, h[0].variance};
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
    return (gc_under_t){top + gc_log(total / (double)n), mean, variance / total};
}

/* Chi-square per degree of freedom that the likeliest hypothesis leaves, at least 1: Birge's ratio. */
static double excess(const gc_face_evidence_t *e) {
    unsigned best = 0;
    for (unsigned i = 1; i < GC_HYPOTHESES; i++) {
        best = e->hypothesis[i].log_evidence > e->hypothesis[best].log_evidence ? i : best;
    }
    return fmax(1.0, e->hypothesis[best].chi2 / (e->blocks > 1u ? (double)(e->blocks - 1u) : 1.0));
}

static void average_face(gc_face_evidence_t *e) {
    unsigned first = 0;
    for (unsigned acting = 0; acting < GC_ACTINGS; acting++) {
        const unsigned n = acting % 2u == 0u ? 1u : GC_TRANSIENTS;
        e->under[acting] = under(e->hypothesis + first, n);
        first += n;
    }
}

static void merge_faces(gc_evidence_t *evidence) {
    const gc_face_evidence_t *a = &evidence->of[0];
    const gc_face_evidence_t *b = &evidence->of[1];
    const double span = a->w_dps - b->w_dps;
    const double excess_a = excess(a), excess_b = excess(b);
    const double log_odds = gc_log(PRESENT / (1.0 - PRESENT));
    gc_posterior_t each[GC_ACTINGS];
    double log_weight[GC_ACTINGS];
    double top = -DBL_MAX, total = 0.0;
    for (unsigned effects = 0; effects < GC_ACTINGS; effects++) {
        const gc_under_t u = a->under[effects], v = b->under[effects];
        const double var_u = u.variance * excess_a, var_v = v.variance * excess_b;
        const double acting = (double)((effects & 1u) + (effects >> 1 & 1u) + (effects >> 2 & 1u));
        each[effects] = (gc_posterior_t){
            {(u.mean - v.mean) / span, (a->w_dps * v.mean - b->w_dps * u.mean) / span},
            {(var_u + var_v) / (span * span), (b->w_dps * b->w_dps * var_u + a->w_dps * a->w_dps * var_v) / (span * span)},
        };
        log_weight[effects] = u.log_evidence + v.log_evidence + acting * log_odds;
        top = fmax(top, log_weight[effects]);
    }
    gc_posterior_t *all = &evidence->average;
    memset(all, 0, sizeof *all);
    for (unsigned i = 0; i < GC_ACTINGS; i++) {
        log_weight[i] = gc_decay(top - log_weight[i]);
        total += log_weight[i];
    }
    for (unsigned j = 0; j < 2u; j++) {
        for (unsigned i = 0; i < GC_ACTINGS; i++) {
            all->mean[j] += log_weight[i] / total * each[i].mean[j];
        }
        for (unsigned i = 0; i < GC_ACTINGS; i++) {
            const double off = each[i].mean[j] - all->mean[j];
            all->variance[j] += log_weight[i] / total * (each[i].variance[j] + off * off);
        }
    }
}

bool gc_evidence_go_on(gc_evidence_t *evidence) {
    const unsigned part = evidence->parts % GC_FACE_PARTS;
    if (evidence->parts + 1u == GC_EVIDENCE_PARTS) {
        merge_faces(evidence);
    } else if (part < GC_WHITEN_PARTS) {
        whiten(evidence, &evidence->of[evidence->parts / GC_FACE_PARTS], part);
    } else if (part < GC_WHITEN_PARTS + 2u) {
        weigh_all(evidence, &evidence->of[evidence->parts / GC_FACE_PARTS], part > GC_WHITEN_PARTS);
    } else {
        average_face(&evidence->of[evidence->parts / GC_FACE_PARTS]);
    }
    return ++evidence->parts == GC_EVIDENCE_PARTS;
}

/* The roots of an answer's expected squared errors. */
static void errors_of(const gc_evidence_t *evidence, const gc_answer_t *answer, double *scale_se, double *bias_se_dps) {
    const gc_posterior_t *all = &evidence->average;
    const double scale_off = answer->scale - all->mean[0];
    const double bias_off = answer->bias_dps - all->mean[1];
    *scale_se = sqrt(all->variance[0] + scale_off * scale_off);
    *bias_se_dps = sqrt(all->variance[1] + bias_off * bias_off);
}

void gc_evidence_errors(const gc_evidence_t *evidence, gc_answer_t *answer) {
    const double dof = (double)evidence->of[0].blocks + (double)evidence->of[1].blocks - 2.0;
    const double chi2 = evidence->of[0].hypothesis[0].chi2 + evidence->of[1].hypothesis[0].chi2;
    errors_of(evidence, answer, &answer->scale_se, &answer->bias_se_dps);
    answer->misfit = dof > 0.0 ? sqrt(chi2 / dof) : NAN;
}

/* Chi-square of what an answer leaves, under the hypothesis that is then the likeliest. */
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

uint32_t gc_evidence_judge(const gc_evidence_t *evidence, gc_answer_t *answer) {
    const gc_face_evidence_t *of = evidence->of;
    double chi2 = 0.0;
    for (unsigned i = 0; i < 2u; i++) {
        chi2 += chi2_at(&of[i], answer->bias_dps + answer->scale * of[i].w_dps);
    }
    answer->misfit = sqrt(chi2 / (double)(of[0].blocks + of[1].blocks));
    double scale_se, bias_se_dps;
    errors_of(evidence, answer, &scale_se, &bias_se_dps);
    /* paper has no standard errors: it is not judged */
    const bool disagrees = scale_se > DISAGREES * answer->scale_se || bias_se_dps > DISAGREES * answer->bias_se_dps;
    return disagrees ? (uint32_t)GC_FLAG_DISAGREES : 0u;
}
