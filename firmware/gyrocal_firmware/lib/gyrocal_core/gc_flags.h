/* Flags that are raised against an answer, as a mask. An answer without flags is trusted. */
#ifndef GC_FLAGS_H
#define GC_FLAGS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* X(identifier, bit, name, meaning) */
#define GC_FLAGS(X)                                                                                             \
    X(GC_FLAG_MISFIT, 0, "misfit", "the readings scatter more than model and noise allow")                      \
    X(GC_FLAG_CLIPPED, 1, "clipped", "a reading is at full scale")                                              \
    X(GC_FLAG_DIRECTION, 2, "direction", "the sensor turns against what face and rate say")                     \
    X(GC_FLAG_IMPLAUSIBLE, 3, "implausible", "scale or bias is beyond what a working sensor has")               \
    X(GC_FLAG_CONSTANT_READING, 4, "constant_reading", "the reading stands still where noise should move it")   \
    X(GC_FLAG_NET_RANGE, 5, "net_range", "the network was not trained for such readings or rates")              \
    X(GC_FLAG_DISAGREES, 6, "disagrees", "a fit of typical effects expects a far larger error than is stated")  \
    X(GC_FLAG_MISSED, 7, "missed", "samples are missing")

enum gc_flag {
#define GC_FLAG_ENUM(id, bit, name, meaning) id = 1 << (bit),
    GC_FLAGS(GC_FLAG_ENUM)
#undef GC_FLAG_ENUM
};

/* Room for all names: "a+b+...". */
enum {
#define GC_FLAG_ROOM(id, bit, name, meaning) +sizeof(name)
    GC_FLAGS_TEXT_MAX = 0 GC_FLAGS(GC_FLAG_ROOM)
#undef GC_FLAG_ROOM
};

/* The names of the flags that are set, joined by '+', as a string; "" for none. Returns its length. */
size_t gc_flags_text(uint32_t flags, char text[GC_FLAGS_TEXT_MAX]);

#ifdef __cplusplus
}
#endif

#endif
