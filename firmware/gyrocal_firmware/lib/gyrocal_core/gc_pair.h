/* Two runs of opposite sense at one rate about one axis, and the answers that are due during the second one.
 *
 * Long computations are divided into parts, one for each sample after a checkpoint: first the baseline's answer with its
 * standard errors, then the model's answer if it has alternatives, then the network's.
 */
#ifndef GC_PAIR_H
#define GC_PAIR_H

#include "gc_calibration.h"
#include "gc_estimator.h"
#include "gc_judge.h"
#include "gc_kept.h"
#include "gc_net.h"
#include "gc_run.h"
#include "gc_tell.h"
#include "gc_trust.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The answers that are due in the run that goes on. One memset clears them when it begins. */
typedef struct {
    bool paired;    /* the run has a partner */
    bool answered;  /* the pair has an answer that may correct: */
    gc_kept_answer_t best; /* at the last checkpoint, by the richest method */
    bool face_told; /* gravity contradicts the face */
    bool weighing;  /* the baseline's standard errors are in progress: */
    unsigned weighed; /* the checkpoint that they are for */
    unsigned evidences; /* checkpoints so far */
    gc_evidence_t evidence;
    bool solving;   /* the model's answer is in progress: */
    unsigned solved; /* the checkpoint that it is for */
    int model_error; /* reported for this pair */
    gc_solution_t solution;
    bool net_off;    /* an error was reported for this pair */
    bool range_told; /* readings beyond the network's range */
    unsigned net_next; /* the checkpoint whose answer by the network comes next */
    gc_net_work_t net_work;
} gc_due_t;

typedef struct {
    gc_teller_t *teller;
    gc_kept_t *kept;
    gc_verdict_t *verdict;
    const gc_calibration_t *calibration;
    bool model; /* the calibration has a model that can be used */
    gc_net_t net;
    unsigned sense; /* sense of the run that goes on or ended last */
    gc_run_t run[GC_SENSES];
    uint32_t flags_at[GC_SENSES][GC_CHECKPOINTS]; /* the flags of its readings until then */
    gc_estimator_t estimator;
    gc_marginal_t first_run[GC_CHECKPOINTS];
    gc_due_t due;
} gc_pair_t;

/* calibration: NULL, or one that passed gc_estimator_check. net may be NULL. All arguments must outlive the pair. */
void gc_pair_init(gc_pair_t *pair, gc_teller_t *teller, gc_kept_t *kept, gc_verdict_t *verdict,
                  const gc_calibration_t *calibration, const gc_cnn_net_t *net);
/* Begins a run of a true rate that is neither 0 nor unknown. The run before it becomes its partner if both fit together; otherwise
   a sentence says why it does not. */
gc_run_t *gc_pair_begin(gc_pair_t *pair, const gc_settings_t *settings, const gc_sensor_t *sensor, int face, bool automatic,
                        uint64_t first);
/* Adds a sample. Returns true at the run's first sample at full scale. */
bool gc_pair_add(gc_pair_t *pair, const gc_taken_t *sample);
void gc_pair_end(gc_pair_t *pair);
/* Returns how many of the two runs are complete. */
unsigned gc_pair_halves(const gc_pair_t *pair);
void gc_pair_forget(gc_pair_t *pair);

#ifdef __cplusplus
}
#endif

#endif
