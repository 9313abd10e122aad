/* Network `gyrocal`, bit by bit: a table's readings, ramps and steps within its range, at each stage. */
#include "gc_net.h"
#include "weights.h"

#include <stdio.h>
#include <string.h>

static void show(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    printf(" %08lx%08lx", (unsigned long)(bits >> 32), (unsigned long)(bits & 0xFFFFFFFFu));
}

int main(int argc, char **argv) {
    static int16_t counts[GC_MAX_CNN_SAMPLES];
    static gc_convnet_work_t work;
    uint32_t state = 1;
    (void)argc;
    (void)argv;
    for (unsigned i = 0; i < 18u; i++) {
        const unsigned stage = i % GC_CONVNET_STAGES;
        const double w_dps = i % 2u ? -78.0 : 78.0;
        gc_convnet_face_t face = {0.0, 0.0, 0.0};
        for (unsigned k = 0; k < GC_MAX_CNN_SAMPLES; k++) {
            const int moved = i < 6u ? 0 : i < 12u ? (int)k / 8 - 54 : k < 116u * (1u + stage) ? 30 : -10;
            state = state * 1664525u + 1013904223u;
            counts[k] = (int16_t)(w_dps / 0.00875 + (double)(state >> 27) + (double)moved);
        }
        printf("%d", gc_convnet_face(gc_net.convnet, counts, stage, 0.00875, w_dps, &work, &face));
        show((double)work.out[0]);
        show((double)work.out[1]);
        show(face.u_dps);
        show(face.precision);
        printf("\n");
    }
    return 0;
}
