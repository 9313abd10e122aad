#include "gc_state.h"

#include "gc_error.h"

int gc_state_next(gc_state_t state, gc_trigger_t trigger) {
    enum { IDLE = GC_STATE_IDLE, RECORDING = GC_STATE_RECORDING, FLIP = GC_STATE_FLIP, DONE = GC_STATE_DONE };
    static const short next[GC_STATES][GC_TRIGGERS] = {
        /*                  START           END_NONE     END_HALF     END_PAIR     FORGET */
        [IDLE] =      {RECORDING,      GC_E_NO_RUN, GC_E_NO_RUN, GC_E_NO_RUN, IDLE},
        [RECORDING] = {GC_E_RECORDING, IDLE,        FLIP,        DONE,        GC_E_RECORDING},
        [FLIP] =      {RECORDING,      GC_E_NO_RUN, GC_E_NO_RUN, GC_E_NO_RUN, IDLE},
        [DONE] =      {RECORDING,      GC_E_NO_RUN, GC_E_NO_RUN, GC_E_NO_RUN, IDLE},
    };
    return next[state][trigger];
}

const char *gc_state_name(gc_state_t state) {
    static const char *const names[GC_STATES] = {"idle", "recording", "flip", "done"};
    return names[state];
}
