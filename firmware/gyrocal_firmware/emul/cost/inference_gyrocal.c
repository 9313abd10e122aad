/* Network `gyrocal` on the raw counts of 6 s of two runs, its layers in float32. */
#include "cost.h"
#include "weights.h"

#include "gc_net.h"

const unsigned cost_times = 20;

static int16_t up[GC_MAX_CNN_SAMPLES], down[GC_MAX_CNN_SAMPLES];

void cost_prepare(void) {
    for (unsigned i = 0; i < GC_MAX_CNN_SAMPLES; i++) {
        up[i] = (int16_t)(8950 + (int)(i * 7u % 23u));
        down[i] = (int16_t)(-8960 + (int)(i * 11u % 23u));
    }
}

void cost_act(void) {
    const double w_dps = (double)gc_net.table_dps;
    const unsigned stage = GC_CONVNET_STAGES - 1u;
    gc_convnet_face_t faces[2];
    static gc_convnet_work_t work;
    gc_answer_t answer;
    (void)gc_convnet_face(gc_net.convnet, up, stage, 0.00875, w_dps, &work, &faces[0]);
    (void)gc_convnet_face(gc_net.convnet, down, stage, 0.00875, -w_dps, &work, &faces[1]);
    gc_convnet_merge(0, &faces[0], &faces[1], &answer);
}
