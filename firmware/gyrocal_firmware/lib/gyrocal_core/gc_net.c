#include "gc_net.h"

#include "gc_baseline.h"
#include "gc_error.h"
#include "gc_store.h"

#include <math.h>
#include <string.h>

/* ---- network gyrocal: a run a part, and the two are merged ---- */

static uint32_t gyrocal_samples(const gc_net_t *net, unsigned stage) {
    return gc_blocknet_samples(net->table->blocks, stage);
}

static int gyrocal_check(const gc_net_t *net) {
    return gyrocal_samples(net, GC_CHECKPOINTS - 1u) <= GC_MAX_CNN_SAMPLES ? GC_OK : GC_E_NET_WINDOW;
}

static int gyrocal_run(const gc_net_t *net, const gc_net_run_t *run, unsigned stage, unsigned sense, gc_blocknet_face_t *face) {
    const gc_blocknet_t *blocks = net->table->blocks;
    float means[GC_BLOCKNET_BLOCKS];
    (void)gc_blocknet_means(blocks, run->counts, gc_blocknet_samples(blocks, stage), run->lsb_dps, run->w_dps, means);
    return gc_blocknet_face(blocks, means, stage, sense, (float)run->w_dps, face);
}

static int gyrocal_go_on(const gc_net_t *net, gc_net_work_t *work, const gc_net_run_t runs[GC_SENSES], unsigned stage,
                         bool *done, gc_net_answer_t *answer) {
    *done = work->half;
    if (!work->half) {
        const int error = gyrocal_run(net, &runs[GC_SENSE_POSITIVE], stage, GC_SENSE_POSITIVE, &work->first);
        work->half = error == GC_OK;
        return error;
    }
    work->half = false;
    gc_blocknet_face_t second;
    const int error = gyrocal_run(net, &runs[GC_SENSE_NEGATIVE], stage, GC_SENSE_NEGATIVE, &second);
    if (error != GC_OK) {
        return error;
    }
    gc_blocknet_answer_t found;
    gc_blocknet_merge(net->table->blocks, &work->first, &second, &found);
    *answer = (gc_net_answer_t){.scale = (double)found.scale,
                                .scale_se = (double)found.scale_sd,
                                .bias_dps = (double)found.bias_dps,
                                .bias_se_dps = (double)found.bias_sd_dps,
                                .in_range = !found.clipped};
    return GC_OK;
}

static uint32_t gyrocal_identity(const gc_blocknet_t *blocks) {
    uint32_t crc = gc_crc32(0, blocks->straight, GC_BLOCKNET_STAGES * GC_BLOCKNET_BLOCKS * sizeof blocks->straight[0]);
    crc = gc_crc32(crc, blocks->first.code, blocks->hidden * GC_BLOCKNET_BLOCKS);
    return gc_crc32(crc, blocks->second.code, blocks->hidden * blocks->hidden);
}

/* ---- network paper: a window of both runs a part; its answer is the mean over windows, without standard errors ---- */

static uint32_t paper_samples(const gc_net_t *net, unsigned stage) {
    const gc_cnn_net_t *table = net->table;
    const double seconds = 1e-6 * (double)GC_CHECKPOINT_US(stage);
    return table->window * (uint32_t)floor(seconds * (double)table->rate_hz / (double)table->window + 1e-6);
}

static int paper_check(const gc_net_t *net) {
    const gc_cnn_net_t *table = net->table;
    if (table->window == 0u || table->window > GC_MAX_CNN_WINDOW || table->outputs != 2u) {
        return GC_E_NET_WINDOW;
    }
    return table->scratch_floats <= GC_MAX_CNN_SCRATCH ? GC_OK : GC_E_NET_MEMORY;
}

static void residuals(const gc_net_run_t *run, uint32_t from, uint32_t n, float *out) {
    const float lsb_dps = (float)run->lsb_dps;
    const float w_dps = (float)run->w_dps;
    for (uint32_t i = 0; i < n; i++) {
        out[i] = (float)run->counts[from + i] * lsb_dps - w_dps;
    }
}

static int paper_go_on(const gc_net_t *net, gc_net_work_t *work, const gc_net_run_t runs[GC_SENSES], unsigned stage, bool *done,
                       gc_net_answer_t *answer) {
    const uint32_t window = net->table->window;
    const gc_net_run_t *up = &runs[GC_SENSE_POSITIVE];
    const gc_net_run_t *down = &runs[GC_SENSE_NEGATIVE];
    if (work->windows * window < paper_samples(net, stage)) {
        float out[2];
        residuals(up, work->windows * window, window, work->up);
        residuals(down, work->windows * window, window, work->down);
        const int error =
            gc_cnn_run(net->table, work->up, work->down, (float)up->w_dps, (float)down->w_dps, work->scratch, out);
        if (error != GC_OK) {
            return error;
        }
        work->sum[0] += (double)out[0];
        work->sum[1] += (double)out[1];
        work->windows++;
    }
    *done = work->windows * window >= paper_samples(net, stage);
    *answer = (gc_net_answer_t){.scale = work->sum[0] / (double)work->windows,
                                .scale_se = NAN,
                                .bias_dps = work->sum[1] / (double)work->windows,
                                .bias_se_dps = NAN,
                                .in_range = true};
    return GC_OK;
}

static uint32_t paper_identity(const gc_cnn_net_t *table) {
    const uint32_t crc = gc_crc32(0, table->up.code, table->head.channels * table->head.kernel);
    return gc_crc32(crc, table->fc2.code, 2u * table->hidden);
}

void gc_net_open(gc_net_t *net, const gc_cnn_net_t *table) {
    memset(net, 0, sizeof *net);
    net->table = table;
    if (table == NULL) {
        return;
    }
    if (table->blocks != NULL) {
        net->name = table->blocks->name;
        net->rate_hz = (double)table->blocks->rate_hz;
        net->identity = gyrocal_identity(table->blocks);
        net->corrects = true;
        net->check = gyrocal_check;
        net->samples = gyrocal_samples;
        net->go_on = gyrocal_go_on;
    } else {
        net->name = table->name;
        net->rate_hz = (double)table->rate_hz;
        net->identity = paper_identity(table);
        net->check = paper_check;
        net->samples = paper_samples;
        net->go_on = paper_go_on;
    }
}
