/* What a device sends of each sample. */
#ifndef GC_STREAM_H
#define GC_STREAM_H

#include "gc_kept.h"
#include "gc_run.h"
#include "gc_sensor.h"
#include "gc_tell.h"
#include "gc_wire.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum { GC_STREAM_OFF, GC_STREAM_RAW, GC_STREAM_TELEPLOT, GC_STREAM_CORRECTED, GC_STREAM_PACKED, GC_STREAMS } gc_stream_t;

/* Returns the stream of a name, or GC_STREAMS for an unknown one. */
gc_stream_t gc_stream_find(gc_text_t name);
const char *gc_stream_name(gc_stream_t stream);
/* Returns false for a stream at a rate that the wire cannot carry. */
bool gc_stream_fits(gc_stream_t stream, double rate_hz);
/* Sends a sample. `n` is its number in the run; -1 = no run goes on. */
void gc_stream_tell(gc_stream_t stream, gc_teller_t *teller, const gc_sensor_t *sensor, const gc_kept_t *kept, int64_t n,
                    const gc_taken_t *taken);

#ifdef __cplusplus
}
#endif

#endif
