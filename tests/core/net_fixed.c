/* Network `gyrocal` on columns at the ends of its range, half of them at each: prints how many of two thousand faces are answered. */
#include "gc_net.h"
#include "weights.h"

#include <stdio.h>

static uint32_t state = 1;

static uint32_t random_below(uint32_t n) {
    state = state * 1664525u + 1013904223u;
    return (uint32_t)(((uint64_t)state * n) >> 32);
}

int main(void) {
    static int16_t counts[GC_MAX_CNN_SAMPLES];
    static gc_convnet_work_t work;
    const double lsb_dps = 0.00875;
    const int end = (int)((double)gc_net.convnet->column_range_dps / lsb_dps);
    unsigned answered = 0;
    for (unsigned i = 0; i < 2000u; i++) {
        const unsigned stage = i % GC_CONVNET_STAGES;
        uint32_t left = gc_net.convnet->stage_columns * (stage + 1u);
        uint32_t up = left / 2u;
        gc_convnet_face_t face;
        for (unsigned k = 0; left > 0u; left--) {
            const bool is_up = random_below(left) < up;
            up -= is_up ? 1u : 0u;
            for (unsigned s = 0; s < gc_net.convnet->pool; s++) {
                counts[k++] = (int16_t)(8914 + (is_up ? end : -end));
            }
        }
        answered += gc_convnet_face(gc_net.convnet, counts, stage, lsb_dps, 78.0, &work, &face) == 0 ? 1u : 0u;
    }
    printf("%u\n", answered);
    return 0;
}
