/* Samples as bytes: a frame stands for up to GC_PACK_MAX $RAW sentences in a row, one of `stream packed` (PROTOCOL.md). */
#ifndef GC_PACK_H
#define GC_PACK_H

#include "gc_sensor.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GC_PACK_MAX 32u
#define GC_PACK_BYTES (27u + 8u * GC_PACK_MAX + 2u) /* head, samples, CRC */
#define GC_PACK_FRAME_MAX (GC_PACK_BYTES + GC_PACK_BYTES / 254u + 3u)

typedef struct {
    uint8_t bytes[GC_PACK_BYTES];
    unsigned samples;
    int64_t number; /* of the newest sample; -1 = no run goes on */
    uint64_t t_us;
    gc_sample_t newest;
} gc_pack_t;

/* Whether a sample can go into the frame: it is the next one, its time is near, and accelerometer and temperature are the same. */
bool gc_pack_takes(const gc_pack_t *pack, int64_t number, uint64_t t_us, const gc_sample_t *sample);
/* Adds one that it takes; the first one's sentence has the number seq. */
void gc_pack_add(gc_pack_t *pack, unsigned imu, uint32_t seq, int64_t number, uint64_t t_us, const gc_sample_t *sample);
/* Empties it and returns the length of its frame, for which there is room for GC_PACK_FRAME_MAX bytes. */
size_t gc_pack_end(gc_pack_t *pack, char *frame);

#ifdef __cplusplus
}
#endif

#endif
