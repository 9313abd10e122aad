/* Standard errors of an answer from two faces, by the evidence for effects in their readings.
 *
 * A face at true rate w (dps) shows u = bias + scale w (dps). Its block means are y - w = u + effects + drift + noise. The effects
 * are ripple of the table, once and twice a turn, and a transient; it is not known whether they act. 44 hypotheses are weighed by
 * their evidence (Bayesian model averaging). Given one hypothesis, everything is Gaussian and has a closed form. The standard
 * error of an answer is the square root of its expected squared error. host/gyrocal/calibration/uncertainty.py and trust.py compute
 * the same on the host.
 */
#ifndef GC_TRUST_H
#define GC_TRUST_H

#include "gc_face.h"
#include "gc_flags.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GC_TRANSIENT_TAUS 5u
#define GC_TRANSIENTS (2u * GC_TRANSIENT_TAUS)        /* of two sizes each */
#define GC_HYPOTHESES (4u * (1u + GC_TRANSIENTS))     /* with or without each ripple; no transient or one */
#define GC_FIRST_ORDER (2u * (1u + GC_TRANSIENTS))    /* those without ripple twice a turn come first */

typedef struct {
    double u_dps;
    double variance;
    double chi2; /* at u_dps */
    double log_evidence;
} gc_hypothesis_t;

/* The columns of a block are four waves, five decays, the constant 1, and the reading. */
#define GC_EVIDENCE_COLUMNS 11u
#define GC_EVIDENCE_PARTS 14u
#define GC_EVIDENCE_EFFECTS 8u /* combinations of three effects that act or do not */

typedef struct {
    const gc_face_t *face;
    double w_dps;
    double origin_dps; /* of its readings, less w */
    unsigned blocks;   /* that count */
    gc_hypothesis_t hypothesis[GC_HYPOTHESES];
} gc_face_evidence_t;

/* Waves and decays at the middle of a block, and the factors that advance them to the next block. */
typedef struct {
    double cosine, sine, decay[GC_TRANSIENT_TAUS];
    double cosine_step, sine_step, decay_step[GC_TRANSIENT_TAUS];
    double ripple_dps;
} gc_shapes_t;

/* The state of the Kalman filter of a face's drift, kept between two parts of the work. */
typedef struct {
    gc_shapes_t shapes;
    double drift[GC_EVIDENCE_COLUMNS];
    double spread;
    double phi;        /* of the drift since the last block */
    double origin_dps; /* the first reading, of which the others are taken */
    bool begun;
} gc_whitening_t;

/* Scale [0] and bias in dps [1] from both faces, with their variances. */
typedef struct {
    double mean[2];
    double variance[2];
} gc_combined_t;

typedef struct {
    gc_face_evidence_t of[2];
    unsigned seen;   /* blocks of each face */
    double lsb_dps;
    double white_dps2; /* noise variance of one sample, dps^2 */
    unsigned parts;    /* of the work that are done */
    double gram[GC_EVIDENCE_COLUMNS][GC_EVIDENCE_COLUMNS]; /* lower triangle, kept between two parts */
    gc_whitening_t whitening;
    gc_combined_t each[GC_EVIDENCE_EFFECTS]; /* given each combination of effects */
    double log_weight[GC_EVIDENCE_EFFECTS];
    gc_combined_t all; /* averaged over the effects */
    double moved;      /* standard errors between it and the last turn of the first run; 0 = not known */
} gc_evidence_t;

/* Begins to weigh the first `blocks` blocks of two faces with one sample rate, at true rates w_a and w_b (dps); one count is
   lsb_dps. The faces must outlive the evidence; samples may still be added to them. Returns GC_OK, GC_E_TOO_SHORT if a face holds
   no block, or GC_E_UNIDENTIFIED if the rates are equal. */
int gc_evidence_begin(gc_evidence_t *evidence, const gc_face_t *a, const gc_face_t *b, unsigned blocks, double w_a_dps,
                      double w_b_dps, double lsb_dps);
/* Does the next part of the work, each of which is short. Returns true when all parts are done. */
bool gc_evidence_go_on(gc_evidence_t *evidence);
/* Sets the standard errors and the misfit of the baseline's answer, which assumes no effects. The misfit is beyond its limit if the
   last whole turn of the run that began first is too far from what the evidence says of it. */
void gc_evidence_errors(const gc_evidence_t *evidence, gc_answer_t *answer);
/* Sets the misfit of a network's answer and returns GC_FLAG_DISAGREES or 0. Unless known_table says that the network was trained
   for tables like this one, standard errors and misfit are found as for the baseline. */
uint32_t gc_evidence_judge(const gc_evidence_t *evidence, bool known_table, gc_answer_t *answer);

#ifdef __cplusplus
}
#endif

#endif
