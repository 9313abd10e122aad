#include "gc_trust.h"

#include "gc_error.h"

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
#define LARGEST_SCALE 0.15
#define LARGEST_BIAS_DPS 50.0
#define DISAGREES 4.0

static const double spin_up[] = {0.0011, 0.0047};
static const double transient_tau_s[] = {0.6, 1.15, 2.2, 4.2, 8.0};

#define SIZES (sizeof spin_up / sizeof spin_up[0])
#define TAUS (sizeof transient_tau_s / sizeof transient_tau_s[0])

/* Columns of a block: four waves, a decay for each time constant, 1, the reading. */
#define WAVES 4u
#define ONE (WAVES + TAUS)
#define Y (ONE + 1u)
#define COLUMNS (Y + 1u)

typedef double gram_t[COLUMNS][COLUMNS]; /* its lower triangle */

static void columns_of(double t_s, double w_dps, double y_dps, double *x) {
    const double angle = RADIANS_A_DEGREE * fabs(w_dps) * t_s;
    const double ripple_dps = RIPPLE * fabs(w_dps) / sqrt(2.0);
    x[0] = ripple_dps * cos(angle);
    x[1] = ripple_dps * sin(angle);
    x[2] = ripple_dps * cos(2.0 * angle);
    x[3] = ripple_dps * sin(2.0 * angle);
    for (size_t i = 0; i < TAUS; i++) {
        x[WAVES + i] = exp(-t_s / transient_tau_s[i]);
    }
    x[ONE] = 1.0;
    x[Y] = y_dps;
}

/* C V^-1 C' of the columns, V the covariance of noise and drift, by a Kalman filter of the drift; the origin of the readings. */
static double whitened_gram(gc_face_evidence_t *e, const gc_face_t *face, unsigned blocks, double variance, double lsb_dps,
                            gram_t gram) {
    double drift[COLUMNS] = {0.0};
    double spread = DRIFT_SD_DPS * DRIFT_SD_DPS;
    double origin_dps = 0.0;
    unsigned before = 0;
    memset(gram, 0, sizeof(gram_t));
    e->blocks = 0;
    for (unsigned k = 0; k < blocks; k++) {
        if (!gc_face_has(face, k)) {
            continue;
        }
        const double n = (double)face->block[k].n;
        const double y_dps = lsb_dps * ((double)face->block[k].sum / n);
        if (e->blocks++ == 0u) {
            origin_dps = y_dps;
        } else {
            const double phi = exp(-(double)(k - before) * BLOCK_S / DRIFT_TAU_S);
            for (size_t j = 0; j < COLUMNS; j++) {
                drift[j] *= phi;
            }
            spread = phi * phi * spread + DRIFT_SD_DPS * DRIFT_SD_DPS * (1.0 - phi * phi);
        }
        before = k;
        double x[COLUMNS];
        columns_of(((double)k + 0.5) * BLOCK_S, e->w_dps, y_dps - origin_dps, x);
        const double total = spread + variance / n;
        for (size_t i = 0; i < COLUMNS; i++) {
            x[i] -= drift[i];
            drift[i] += spread / total * x[i];
            for (size_t j = 0; j <= i; j++) {
                gram[i][j] += x[i] * x[j] / total;
            }
        }
        spread *= variance / n / total;
    }
    return origin_dps + lsb_dps * face->origin - e->w_dps;
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
    const double share = size * size / (1.0 + size * size * g[e][e]);
    const double one = g[ONE][ONE] - share * g[ONE][e] * g[ONE][e];
    const double one_y = g[Y][ONE] - share * g[ONE][e] * g[Y][e];
    const double y = g[Y][Y] - share * g[Y][e] * g[Y][e];
    h->u_dps = one_y / one + origin_dps;
    h->variance = 1.0 / one + standing;
    h->chi2 = fmax(y - one_y * one_y / one, 0.0);
    h->log_evidence = -0.5 * (h->chi2 + log(det * (1.0 + size * size * g[e][e]) * one));
}

int gc_evidence_begin(gc_evidence_t *evidence, const gc_face_t *a, const gc_face_t *b, unsigned blocks, double lsb_dps) {
    memset(evidence, 0, sizeof *evidence);
    evidence->lsb_dps = lsb_dps;
    evidence->variance = gc_face_white_variance(a, b, blocks);
    for (unsigned k = 0; k < blocks; k++) {
        evidence->blocks += (a->block[k].n > 0u ? 1u : 0u) + (b->block[k].n > 0u ? 1u : 0u);
    }
    return evidence->variance >= 0.0 ? GC_OK : GC_E_TOO_SHORT;
}

int gc_evidence_face(gc_evidence_t *evidence, unsigned which, const gc_face_t *face, unsigned blocks, double w_dps) {
    gc_face_evidence_t *e = &evidence->face[which];
    const double step = evidence->lsb_dps * evidence->lsb_dps;
    const double own = step * evidence->variance;
    const double standing = 4.0 * own < step ? step / 12.0 : 0.0;
    const double variance = fmax(own, fmax(step / 12.0, SMALLEST_SD_DPS * SMALLEST_SD_DPS));
    gram_t gram, left;
    e->w_dps = w_dps;
    const double origin_dps = whitened_gram(e, face, blocks, variance, evidence->lsb_dps, gram);
    if (e->blocks == 0u) {
        return GC_E_TOO_SHORT;
    }
    gc_hypothesis_t *h = e->hypothesis;
    for (unsigned waves = 0; waves < 4u; waves++) {
        double det = 1.0;
        memcpy(left, gram, sizeof left);
        for (size_t j = 0; j < WAVES; j++) {
            if ((waves & (1u << (j / 2u))) != 0u) {
                det *= eliminate(left, j);
            }
        }
        weigh(left, det, 0, 0.0, origin_dps, standing, h++);
        for (size_t i = 0; i < SIZES; i++) {
            const double size = sqrt(w_dps * w_dps * spin_up[i] * spin_up[i] + WARMUP_DPS * WARMUP_DPS);
            for (size_t k = 0; k < TAUS; k++) {
                weigh(left, det, k, size, origin_dps, standing, h++);
            }
        }
    }
    return GC_OK;
}

/* ---- averages over hypotheses ---- */

typedef struct {
    double log_evidence;
    double mean;
    double variance;
} under_t;

/* What a face says if some effects act: hypotheses first to first + n - 1. */
static under_t under(const gc_hypothesis_t *h, unsigned n) {
    double top = -DBL_MAX, total = 0.0, mean = 0.0, variance = 0.0;
    for (unsigned i = 0; i < n; i++) {
        top = fmax(top, h[i].log_evidence);
    }
    for (unsigned i = 0; i < n; i++) {
        const double weight = exp(h[i].log_evidence - top);
        total += weight;
        mean += weight * h[i].u_dps;
    }
    mean /= total;
    for (unsigned i = 0; i < n; i++) {
        const double off = h[i].u_dps - mean;
        variance += exp(h[i].log_evidence - top) * (h[i].variance + off * off);
    }
    return (under_t){top + log(total / (double)n), mean, variance / total};
}

/* Chi-square per degree of freedom that the likeliest hypothesis leaves, at least 1: Birge's ratio. */
static double excess(const gc_face_evidence_t *e, unsigned hypotheses) {
    unsigned best = 0;
    for (unsigned i = 1; i < hypotheses; i++) {
        best = e->hypothesis[i].log_evidence > e->hypothesis[best].log_evidence ? i : best;
    }
    return fmax(1.0, e->hypothesis[best].chi2 / (e->blocks > 1u ? (double)(e->blocks - 1u) : 1.0));
}

typedef struct {
    double mean[2]; /* scale, bias */
    double variance[2];
} combined_t;

static combined_t combine(const gc_evidence_t *evidence, unsigned hypotheses) {
    const gc_face_evidence_t *a = &evidence->face[0];
    const gc_face_evidence_t *b = &evidence->face[1];
    const double span = a->w_dps - b->w_dps;
    const double excess_a = excess(a, hypotheses), excess_b = excess(b, hypotheses);
    combined_t each[8];
    double log_weight[8];
    double top = -DBL_MAX, total = 0.0;
    unsigned effects = 0;
    for (unsigned first = 0; first < hypotheses; effects++) {
        const unsigned n = effects % 2u == 0u ? 1u : GC_TRANSIENTS;
        const under_t u = under(a->hypothesis + first, n);
        const under_t v = under(b->hypothesis + first, n);
        const double var_u = u.variance * excess_a, var_v = v.variance * excess_b;
        const double acting = (double)((effects & 1u) + (effects >> 1 & 1u) + (effects >> 2 & 1u));
        each[effects] = (combined_t){
            {(u.mean - v.mean) / span, (a->w_dps * v.mean - b->w_dps * u.mean) / span},
            {(var_u + var_v) / (span * span), (b->w_dps * b->w_dps * var_u + a->w_dps * a->w_dps * var_v) / (span * span)},
        };
        log_weight[effects] = u.log_evidence + v.log_evidence + acting * log(PRESENT) + (3.0 - acting) * log(1.0 - PRESENT);
        top = fmax(top, log_weight[effects]);
        first += n;
    }
    combined_t all = {{0.0, 0.0}, {0.0, 0.0}};
    for (unsigned i = 0; i < effects; i++) {
        log_weight[i] = exp(log_weight[i] - top);
        total += log_weight[i];
    }
    for (unsigned j = 0; j < 2u; j++) {
        for (unsigned i = 0; i < effects; i++) {
            all.mean[j] += log_weight[i] / total * each[i].mean[j];
        }
        for (unsigned i = 0; i < effects; i++) {
            const double off = each[i].mean[j] - all.mean[j];
            all.variance[j] += log_weight[i] / total * (each[i].variance[j] + off * off);
        }
    }
    return all;
}

int gc_evidence_errors(const gc_evidence_t *evidence, gc_answer_t *answer) {
    if (evidence->face[0].w_dps == evidence->face[1].w_dps) {
        return GC_E_UNIDENTIFIED;
    }
    const combined_t all = combine(evidence, GC_HYPOTHESES);
    const double scale_off = answer->scale - all.mean[0];
    const double bias_off = answer->bias_dps - all.mean[1];
    const double dof = (double)evidence->face[0].blocks + (double)evidence->face[1].blocks - 2.0;
    const double chi2 = evidence->face[0].hypothesis[0].chi2 + evidence->face[1].hypothesis[0].chi2;
    answer->scale_se = sqrt(all.variance[0] + scale_off * scale_off);
    answer->bias_se_dps = sqrt(all.variance[1] + bias_off * bias_off);
    answer->misfit = dof > 0.0 ? sqrt(chi2 / dof) : NAN;
    return GC_OK;
}

/* Chi-square of what an answer leaves, under the hypothesis that is then the likeliest. */
static double chi2_at(const gc_face_evidence_t *e, double u_dps) {
    double best = -DBL_MAX, chi2 = 0.0;
    for (unsigned i = 0; i < GC_FIRST_ORDER; i++) {
        const gc_hypothesis_t *h = &e->hypothesis[i];
        const double off = u_dps - h->u_dps;
        const double more = off * off / h->variance;
        const double at = h->log_evidence - 0.5 * (more + log(h->variance));
        if (at > best) {
            best = at;
            chi2 = h->chi2 + more;
        }
    }
    return chi2;
}

uint32_t gc_evidence_judge(const gc_evidence_t *evidence, gc_answer_t *answer) {
    const gc_face_evidence_t *face = evidence->face;
    double chi2 = 0.0;
    for (unsigned i = 0; i < 2u; i++) {
        chi2 += chi2_at(&face[i], answer->bias_dps + answer->scale * face[i].w_dps);
    }
    answer->misfit = sqrt(chi2 / (double)(face[0].blocks + face[1].blocks));
    const combined_t fit = combine(evidence, GC_FIRST_ORDER);
    const double scale_off = fabs(answer->scale - fit.mean[0]) / sqrt(fit.variance[0] + answer->scale_se * answer->scale_se);
    const double bias_off = fabs(answer->bias_dps - fit.mean[1]) / sqrt(fit.variance[1] + answer->bias_se_dps * answer->bias_se_dps);
    return scale_off <= DISAGREES && bias_off <= DISAGREES ? 0u : (uint32_t)GC_FLAG_DISAGREES;
}

uint32_t gc_answer_flags(const gc_answer_t *answer, unsigned blocks) {
    uint32_t flags = 0;
    if (answer->scale < -1.0) {
        flags |= GC_FLAG_DIRECTION;
    }
    if (!(fabs(answer->scale) <= LARGEST_SCALE && fabs(answer->bias_dps) <= LARGEST_BIAS_DPS)) {
        flags |= GC_FLAG_IMPLAUSIBLE;
    }
    if (answer->misfit > GC_TRUST_MISFIT_LIMIT(blocks)) {
        flags |= GC_FLAG_MISFIT;
    }
    return flags;
}
