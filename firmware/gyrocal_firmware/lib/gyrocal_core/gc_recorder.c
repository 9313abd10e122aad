#include "gc_recorder.h"

#include "gc_error.h"

#include <math.h>
#include <string.h>

void gc_recorder_init(gc_recorder_t *r, gc_teller_t *teller, gc_kept_t *kept, const gc_calibration_t *calibration,
                      const gc_cnn_net_t *net) {
    memset(r, 0, sizeof *r);
    r->teller = teller;
    r->kept = kept;
    r->verdict.misfit = NAN;
    gc_pair_init(&r->pair, teller, kept, &r->verdict, calibration, net);
}

int gc_recorder_allows(const gc_recorder_t *r, gc_trigger_t trigger) {
    const int next = gc_state_next(r->state, trigger);
    return next < 0 ? next : GC_OK;
}

/* The state stays the same if the trigger is refused. */
static void enter(gc_recorder_t *r, gc_trigger_t trigger) {
    const int next = gc_state_next(r->state, trigger);
    r->state = next < 0 ? r->state : (gc_state_t)next;
}

void gc_recorder_begin(gc_recorder_t *r, const gc_settings_t *settings, const gc_sensor_t *sensor, int face, bool automatic,
                       uint64_t next) {
    gc_kept_end_dump(r->kept); /* the windows of the dump are about to be overwritten */
    if (fabs(gc_run_true_rate_dps(settings, face)) > 0.0) {
        r->run = gc_pair_begin(&r->pair, settings, sensor, face, automatic, next);
    } else {
        r->run = &r->alone;
        gc_run_begin(r->run, settings, sensor, face, automatic, next);
    }
    enter(r, GC_TRIGGER_START);
    gc_run_tell(r->run, r->teller, false, next);
}

void gc_recorder_add(gc_recorder_t *r, const gc_taken_t *sample) {
    bool clips;
    if (r->run != &r->alone) {
        clips = gc_pair_add(&r->pair, sample);
    } else {
        gc_run_advance(r->run, sample->t_us);
        clips = gc_run_add(r->run, sample);
    }
    if (clips) {
        gc_tell_error(r->teller, GC_E_CLIPPED);
    }
}

static void end_alone(gc_recorder_t *r) {
    gc_run_end(r->run);
    gc_run_tell_faults(r->run, r->teller);
    if (r->run->settings.turn_deg != 0.0) {
        gc_rest_end_turn(&r->rest, r->run, r->teller, r->kept);
    } else if (r->run->w_dps == 0.0) {
        gc_rest_end(&r->rest, r->run, r->teller, r->kept, &r->verdict);
    }
}

void gc_recorder_end(gc_recorder_t *r, uint64_t next) {
    static const gc_trigger_t by_halves[] = {GC_TRIGGER_END_NONE, GC_TRIGGER_END_HALF, GC_TRIGGER_END_PAIR};
    if (r->run == &r->alone) {
        end_alone(r);
    } else {
        gc_pair_end(&r->pair);
    }
    enter(r, by_halves[gc_pair_halves(&r->pair)]);
    gc_run_tell(r->run, r->teller, true, next);
}

void gc_recorder_forget(gc_recorder_t *r) {
    enter(r, GC_TRIGGER_FORGET);
    r->run = NULL;
    gc_pair_forget(&r->pair);
    memset(&r->rest, 0, sizeof r->rest);
    r->verdict = (gc_verdict_t){.misfit = NAN};
}
