/* Records runs, one at a time. A run of known rate is one half of a pair; a run at rest, of known angle or of unknown rate has no
 * partner. The answers of a run are sent and kept as they come. */
#ifndef GC_RECORDER_H
#define GC_RECORDER_H

#include "gc_calibration.h"
#include "gc_cnn.h"
#include "gc_kept.h"
#include "gc_pair.h"
#include "gc_rest.h"
#include "gc_run.h"
#include "gc_state.h"
#include "gc_tell.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    gc_teller_t *teller;
    gc_kept_t *kept;
    gc_state_t state;
    gc_run_t *run;        /* the current or the last run: `alone`, or one of the pair; NULL = none yet */
    gc_run_t alone;       /* the run without a partner */
    gc_rest_t rest;
    gc_pair_t pair;
    gc_verdict_t verdict; /* on the last answer */
} gc_recorder_t;

/* calibration: NULL, or one that passed gc_estimator_check. net may be NULL. All arguments must outlive the recorder, which must
   stay where it is. */
void gc_recorder_init(gc_recorder_t *recorder, gc_teller_t *teller, gc_kept_t *kept, const gc_calibration_t *calibration,
                      const gc_cnn_net_t *net);
/* Returns GC_OK, or the error with which the state refuses the trigger. Ask it before the functions below. */
int gc_recorder_allows(const gc_recorder_t *recorder, gc_trigger_t trigger);

/* Begin or end a run, and send its $RUN. `next` is the number of the next sample. */
void gc_recorder_begin(gc_recorder_t *recorder, const gc_settings_t *settings, const gc_sensor_t *sensor, int face,
                       bool automatic, uint64_t next);
void gc_recorder_end(gc_recorder_t *recorder, uint64_t next);
/* Adds a sample to the run that goes on. */
void gc_recorder_add(gc_recorder_t *recorder, const gc_taken_t *sample);
/* Forgets the runs, and what was measured in them at rest. Answers that were kept stay. */
void gc_recorder_forget(gc_recorder_t *recorder);

#ifdef __cplusplus
}
#endif

#endif
