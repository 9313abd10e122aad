#include "gc_net.h"

#include "gc_baseline.h"
#include "gc_error.h"
#include "gc_store.h"

#include <math.h>
#include <string.h>

/* ---- network gyrocal: one run, then the other, each in parts, and the two are merged ---- */

static uint32_t gyrocal_samples(const gc_net_t *net, unsigned stage) {
    return gc_convnet_samples(net->table->convnet, stage);
}

static int gyrocal_check(const gc_net_t *net) {
    return gyrocal_samples(net, GC_CHECKPOINTS - 1u) <= GC_MAX_CNN_SAMPLES ? GC_OK : GC_E_NET_WINDOW;
}

static int gyrocal_go_on(const gc_net_t *net, gc_net_work_t *work, const gc_net_run_t runs[GC_SENSES],
                         const gc_calibration_t *prior, unsigned stage, bool *done, gc_net_answer_t *answer) {
    const gc_convnet_t *convnet = net->table->convnet;
    const gc_net_run_t *run = &runs[work->half ? GC_SENSE_NEGATIVE : GC_SENSE_POSITIVE];
    gc_convnet_face_t face;
    *done = false;
    if (!(runs[GC_SENSE_POSITIVE].w_dps > 0.0) || !(runs[GC_SENSE_NEGATIVE].w_dps < 0.0)) {
        return GC_E_NET_RATE; /* two runs of one sense do not tell scale from bias */
    }
    if (!work->begun) {
        const int error = gc_convnet_begin(convnet, run->counts, stage, run->lsb_dps, run->w_dps, &work->face);
        work->begun = error == GC_OK;
        work->half = work->half && work->begun;
        return error;
    }
    if (!gc_convnet_go_on(convnet, &work->face, &face)) {
        return GC_OK;
    }
    work->begun = false;
    *done = work->half;
    work->half = !work->half;
    if (!*done) {
        work->first = face;
        return GC_OK;
    }
    gc_answer_t found = {0};
    gc_convnet_merge(prior, &work->first, &face, &found);
    *answer = (gc_net_answer_t){.scale = found.scale,
                                .scale_se = found.scale_se,
                                .bias_dps = found.bias_dps,
                                .bias_se_dps = found.bias_se_dps};
    return GC_OK;
}

static uint32_t gyrocal_identity(const gc_convnet_t *net) {
    const uint32_t columns = GC_CONVNET_STAGES * net->stage_columns;
    uint32_t crc = gc_crc32(0, net->straight, GC_CONVNET_STAGES * columns * sizeof net->straight[0]);
    crc = gc_crc32(crc, net->first_layer.code, net->hidden);
    return gc_crc32(crc, net->last_layer.code, 2u * net->hidden);
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

static int paper_go_on(const gc_net_t *net, gc_net_work_t *work, const gc_net_run_t runs[GC_SENSES],
                       const gc_calibration_t *prior, unsigned stage, bool *done, gc_net_answer_t *answer) {
    (void)prior; /* the prior is in the weights */
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
                                .bias_se_dps = NAN};
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
    if (table->convnet != NULL) {
        net->name = table->convnet->name;
        net->rate_hz = (double)table->convnet->rate_hz;
        net->identity = gyrocal_identity(table->convnet);
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
