/* The states of a device, and the table of transitions between them. */
#ifndef GC_STATE_H
#define GC_STATE_H

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    GC_STATE_IDLE,
    GC_STATE_RECORDING,
    GC_STATE_FLIP, /* half of a pair is there: the table is to be turned over */
    GC_STATE_DONE, /* both halves are there */
    GC_STATES
} gc_state_t;

typedef enum {
    GC_TRIGGER_START,      /* a run begins */
    GC_TRIGGER_END_NONE,   /* a run ends, and no half of a pair is there */
    GC_TRIGGER_END_HALF,   /* one is */
    GC_TRIGGER_END_PAIR,   /* both are */
    GC_TRIGGER_FORGET,     /* runs and results are forgotten */
    GC_TRIGGERS
} gc_trigger_t;

/* Returns the next state, or the negative error with which the trigger is refused. */
int gc_state_next(gc_state_t state, gc_trigger_t trigger);
const char *gc_state_name(gc_state_t state);

#ifdef __cplusplus
}
#endif

#endif
