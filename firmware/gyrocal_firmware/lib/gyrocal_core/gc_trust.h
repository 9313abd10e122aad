/* How far off an answer from two faces may be.
 *
 * A face at true rate w says u = bias + scale w. Its block means are y - w = u + effects + drift + noise. The effects are ripple of
 * the table, once and twice a turn, and a transient; whether they act is not known. 44 hypotheses are weighed by their evidence
 * (Bayesian model averaging); given one of them, all is Gaussian and in closed form. An answer's standard error is the root of
 * its expected squared error. The twin of host/gyrocal/calibration/uncertainty.py and trust.py.
 */
#ifndef GC_TRUST_H
#define GC_TRUST_H

#include "gc_face.h"
#include "gc_flags.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GC_TRANSIENT_TAUS 5u
#define GC_TRANSIENTS (2u * GC_TRANSIENT_TAUS)        /* two sizes */
#define GC_HYPOTHESES (4u * (1u + GC_TRANSIENTS))     /* ripple twice a turn, once a turn; no transient or one */
#define GC_FIRST_ORDER (2u * (1u + GC_TRANSIENTS))    /* the first of them: without ripple twice a turn */

typedef struct {
    double u_dps;
    double variance;
    double chi2; /* at u_dps */
    double log_evidence;
} gc_hypothesis_t;

/* A block's columns: four waves, five decays, 1, the reading. */
#define GC_EVIDENCE_COLUMNS 11u
#define GC_EVIDENCE_PARTS 14u
#define GC_EVIDENCE_EFFECTS 8u /* which of three effects act */

typedef struct {
    const gc_face_t *face;
    double w_dps;
    double origin_dps; /* of its readings, less w */
    unsigned blocks;   /* that count */
    gc_hypothesis_t hypothesis[GC_HYPOTHESES];
} gc_face_evidence_t;

/* Waves and decays at the middle of a block, and what takes them to the next block. */
typedef struct {
    double cosine, sine, decay[GC_TRANSIENT_TAUS];
    double cosine_step, sine_step, decay_step[GC_TRANSIENT_TAUS];
    double ripple_dps;
} gc_shapes_t;

/* A Kalman filter of a face's drift, between two parts. */
typedef struct {
    gc_shapes_t shapes;
    double drift[GC_EVIDENCE_COLUMNS];
    double spread;
    double phi;        /* of the drift since the last block */
    double origin_dps; /* the first reading, of which the others are taken */
    bool begun;
} gc_whitening_t;

/* Scale and bias by both faces, with their variances. */
typedef struct {
    double mean[2];
    double variance[2];
} gc_combined_t;

typedef struct {
    gc_face_evidence_t of[2];
    unsigned seen;   /* blocks of each face */
    double lsb_dps;
    double white_dps2; /* variance of a sample */
    unsigned parts;    /* that are done */
    double gram[GC_EVIDENCE_COLUMNS][GC_EVIDENCE_COLUMNS]; /* its lower triangle, between two parts */
    gc_whitening_t whitening;
    gc_combined_t each[GC_EVIDENCE_EFFECTS]; /* if those act */
    double log_weight[GC_EVIDENCE_EFFECTS];
    gc_combined_t all; /* averaged over the effects */
} gc_evidence_t;

/* The evidence in the first `blocks` blocks of two faces of one sample rate at true rates w_a and w_b. The faces must outlive
   it; they may go on. GC_E_TOO_SHORT: a face holds no block. GC_E_UNIDENTIFIED: the rates are equal. */
int gc_evidence_begin(gc_evidence_t *evidence, const gc_face_t *a, const gc_face_t *b, unsigned blocks, double w_a_dps,
                      double w_b_dps, double lsb_dps);
/* One of its parts, none of which takes long; true when all are done. */
bool gc_evidence_go_on(gc_evidence_t *evidence);
/* The standard errors and the misfit of an answer that knows of no effects. */
void gc_evidence_errors(const gc_evidence_t *evidence, gc_answer_t *answer);
/* The misfit of a network's answer, and GC_FLAG_DISAGREES or 0. Unless the tables of its training are known to be like this one,
   the answer's standard errors become at least those of the averaged fit, and at least its distance from that. */
uint32_t gc_evidence_judge(const gc_evidence_t *evidence, bool known_table, gc_answer_t *answer);

#ifdef __cplusplus
}
#endif

#endif
