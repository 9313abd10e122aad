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

#define GC_TRANSIENTS 10u                             /* two sizes, five time constants */
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
#define GC_EVIDENCE_PARTS 6u

typedef struct {
    const gc_face_t *face;
    double w_dps;
    double origin_dps; /* of its readings, less w */
    unsigned blocks;   /* that count */
    gc_hypothesis_t hypothesis[GC_HYPOTHESES];
} gc_face_evidence_t;

typedef struct {
    gc_face_evidence_t of[2];
    unsigned seen;   /* blocks of each face */
    double lsb_dps;
    double white_dps2; /* variance of a sample */
    unsigned parts;    /* that are done */
    double gram[GC_EVIDENCE_COLUMNS][GC_EVIDENCE_COLUMNS]; /* its lower triangle, between two parts */
} gc_evidence_t;

/* The evidence in the first `blocks` blocks of two faces of one sample rate at true rates w_a and w_b. The faces must outlive
   it; they may go on. GC_E_TOO_SHORT: a face holds no block. GC_E_UNIDENTIFIED: the rates are equal. */
int gc_evidence_begin(gc_evidence_t *evidence, const gc_face_t *a, const gc_face_t *b, unsigned blocks, double w_a_dps,
                      double w_b_dps, double lsb_dps);
/* One of its parts, none of which takes long; true when all are done. */
bool gc_evidence_go_on(gc_evidence_t *evidence);
/* The standard errors and the misfit of an answer that knows of no effects. */
void gc_evidence_errors(const gc_evidence_t *evidence, gc_answer_t *answer);
/* The misfit of a network's answer, and GC_FLAG_DISAGREES or 0. */
uint32_t gc_evidence_judge(const gc_evidence_t *evidence, gc_answer_t *answer);

#ifdef __cplusplus
}
#endif

#endif
