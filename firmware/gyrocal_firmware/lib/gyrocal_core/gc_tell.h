/* Sends the sentences of a device, each with a number, a time and its sensor. Those that the port does not take are counted. */
#ifndef GC_TELL_H
#define GC_TELL_H

#include "gc_pack.h"
#include "gc_port.h"
#include "gc_sensor.h"
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
    gc_pack_t pack;         /* samples that have their numbers and are not sent yet */
} gc_teller_t;

void gc_teller_init(gc_teller_t *teller, const gc_port_t *port, unsigned imu);

/* Begin a sentence. Add fields to it, then send it with gc_tell_end. */
gc_sentence_t *gc_tell_begin_at(gc_teller_t *teller, const char tag[3], uint64_t t_us);
gc_sentence_t *gc_tell_begin(gc_teller_t *teller, const char tag[3]);
void gc_tell_end(gc_teller_t *teller);
/* Puts a sample into a frame, which goes when it is full, when a sentence follows it, or by gc_tell_packed. */
void gc_tell_pack(gc_teller_t *teller, int64_t number, uint64_t t_us, const gc_sample_t *sample);
void gc_tell_packed(gc_teller_t *teller);
/* As gc_tell_end, but returns false if there is no room. The sentence then takes no number and can be sent again. */
bool gc_tell_end_or_wait(gc_teller_t *teller);

void gc_tell_error(gc_teller_t *teller, int code);
/* Acknowledges a command, with a name and its value unless name is NULL. */
void gc_tell_ack(gc_teller_t *teller, const char *command, const char *name, const char *value);
/* Tells what a self-test found ($TST). */
void gc_tell_self_test(gc_teller_t *teller, const gc_self_test_t *result);

const char *gc_axis_name(int axis);
const char *gc_face_name(int face);

#ifdef __cplusplus
}
#endif

#endif
