/* Two numbers of 16 bits in a word: some CPUs (Cortex-M4, M7, M33) multiply, add and compare both at once. The code without these
   instructions gives the same bits. */
#ifndef GC_HALFWORDS_H
#define GC_HALFWORDS_H

#include <stdint.h>

#if defined(__ARM_FEATURE_SIMD32) && !defined(__ARM_BIG_ENDIAN)
#define GC_HAS_HALFWORDS 1

#include <arm_acle.h>
#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GC_HALFWORDS_OF_ONE 0x00010001

/* The pair at any even address. */
static inline int16x2_t gc_halfwords_at(const int16_t *at) {
    int16x2_t both;
    memcpy(&both, at, sizeof both);
    return both;
}

/* The larger of each of the two numbers. */
static inline int16x2_t gc_halfwords_larger(int16x2_t a, int16x2_t b) {
    (void)__ssub16(a, b); /* sets the flags that are chosen by */
    return (int16x2_t)__sel((uint8x4_t)a, (uint8x4_t)b);
}

static inline int16x2_t gc_halfwords_smaller(int16x2_t a, int16x2_t b) {
    (void)__ssub16(a, b);
    return (int16x2_t)__sel((uint8x4_t)b, (uint8x4_t)a);
}

#ifdef __cplusplus
}
#endif

#else
#define GC_HAS_HALFWORDS 0
#endif

#endif
