/* The sentences that a device tells: numbered, at a time, for its sensor; those that the port does not take are counted. */
#ifndef GC_TELL_H
#define GC_TELL_H

#include "gc_port.h"
#include "gc_wire.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    const gc_port_t *port;
    unsigned imu; /* the sensor's number on the wire */
    uint32_t seq;
    uint32_t lost;
    gc_sentence_t sentence; /* in progress */
} gc_teller_t;

void gc_teller_init(gc_teller_t *teller, const gc_port_t *port, unsigned imu);

/* Fields are added to what is returned, until gc_tell_end sends it. */
gc_sentence_t *gc_tell_begin_at(gc_teller_t *teller, const char tag[3], uint64_t t_us);
gc_sentence_t *gc_tell_begin(gc_teller_t *teller, const char tag[3]);
void gc_tell_end(gc_teller_t *teller);
/* As gc_tell_end, but a sentence that finds no room was never begun: false, and it can be told again. */
bool gc_tell_end_or_wait(gc_teller_t *teller);

void gc_tell_error(gc_teller_t *teller, int code);
/* The command was taken, with this value of this name; name NULL: without. */
void gc_tell_ack(gc_teller_t *teller, const char *command, const char *name, const char *value);

const char *gc_axis_name(int axis);
const char *gc_face_name(int face);

#ifdef __cplusplus
}
#endif

#endif
