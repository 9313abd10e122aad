/* Network `gyrocal` on the block means of 6 s of two runs. */
#include "cost.h"
#include "weights.h"

const unsigned cost_times = 100;

static float up[GC_BLOCKNET_BLOCKS], down[GC_BLOCKNET_BLOCKS];

void cost_prepare(void) {
    for (unsigned i = 0; i < GC_BLOCKNET_BLOCKS; i++) {
        up[i] = 0.2f + 0.01f * (float)(i * 7u % 23u);
        down[i] = -0.4f + 0.01f * (float)(i * 11u % 23u);
    }
}

void cost_act(void) {
    gc_blocknet_answer_t answer;
    gc_blocknet_run(gc_net.blocks, up, down, GC_BLOCKNET_STAGES - 1u, gc_net.table_dps, -gc_net.table_dps, &answer);
}
