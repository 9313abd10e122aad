#include "gc_blocknet.h"

#include <math.h>

#include "gc_error.h"
#include "gc_math.h"

#define BLOCKS_A_STAGE (GC_BLOCKNET_BLOCKS / GC_BLOCKNET_STAGES)
#define BLOCKS_A_SECOND 4.0

uint32_t gc_blocknet_samples(const gc_blocknet_t *net, unsigned stage) {
    return (uint32_t)((double)((stage + 1u) * BLOCKS_A_STAGE) / BLOCKS_A_SECOND * (double)net->rate_hz + 0.5);
}

/* Sample i is in block floor(i * blocks_a_sample): the first one of a block. */
static uint32_t first_sample(uint32_t block, double blocks_a_sample) {
    uint32_t i = (uint32_t)((double)block / blocks_a_sample);
    while ((uint32_t)((double)i * blocks_a_sample) < block) {
        i++;
    }
    return i;
}

uint32_t gc_blocknet_means(const gc_blocknet_t *net, const int16_t *counts, uint32_t n, double lsb_dps, double w_dps, float *means) {
    const double blocks_a_sample = BLOCKS_A_SECOND / (double)net->rate_hz;
    uint32_t block = 0;
    for (uint32_t i = 0; i < n && block < GC_BLOCKNET_BLOCKS; block++) {
        const uint32_t begin = i;
        const uint32_t next = first_sample(block + 1u, blocks_a_sample);
        int64_t sum = 0;
        for (; i < n && i < next; i++) {
            sum += counts[i];
        }
        means[block] = (float)(lsb_dps * (double)sum / (double)(i - begin) - w_dps);
    }
    return block;
}

static float leaky(float y, float leak) {
    return y < 0.0f ? leak * y : y;
}

int gc_blocknet_face(const gc_blocknet_t *net, const float *means, unsigned stage, unsigned face, float w_dps,
                     gc_blocknet_face_t *out) {
    if (!gc_cnn_same_rate(w_dps, face == 0u ? net->table_dps : -net->table_dps)) {
        return GC_E_NET_RATE;
    }
    if (stage >= GC_BLOCKNET_STAGES || net->hidden == 0u || net->hidden > GC_BLOCKNET_MAX_HIDDEN) {
        return GC_E_NET_WINDOW;
    }
    const uint32_t seen = (stage + 1u) * BLOCKS_A_STAGE;
    const float *straight = net->straight + stage * GC_BLOCKNET_BLOCKS;
    const float *start = net->first.bias + stage * net->hidden;
    float x[GC_BLOCKNET_BLOCKS];
    float first[GC_BLOCKNET_MAX_HIDDEN];
    float second[GC_BLOCKNET_MAX_HIDDEN];
    out->mean = 0.0f;
    out->clipped = false;
    for (uint32_t i = 0; i < seen; i++) {
        float y = means[i];
        if (y > net->clip_dps || y < -net->clip_dps) {
            y = y > 0.0f ? net->clip_dps : -net->clip_dps;
            out->clipped = true;
        }
        x[i] = net->gain[face] * y + net->offset[face];
        out->mean += straight[i] * x[i];
    }
    for (uint32_t i = 0; i < net->hidden; i++) {
        const int8_t *row = net->first.code + i * GC_BLOCKNET_BLOCKS;
        float sum = 0.0f;
        for (uint32_t k = 0; k < seen; k++) {
            sum += (float)row[k] * x[k];
        }
        first[i] = leaky(start[i] + net->first.step[i] * sum, net->leak);
    }
    for (uint32_t i = 0; i < net->hidden; i++) {
        second[i] = leaky(gc_cnn_neuron(&net->second, i, first, net->hidden), net->leak);
    }
    out->mean += gc_cnn_neuron(&net->last, 0, second, net->hidden);
    float log_precision = gc_cnn_neuron(&net->last, 1, second, net->hidden);
    log_precision = log_precision > net->log_precision ? net->log_precision : log_precision;
    log_precision = log_precision < -net->log_precision ? -net->log_precision : log_precision;
    out->precision = gc_exp(log_precision);
    return out->mean == out->mean ? GC_OK : GC_E_NET_INPUT; /* a NaN among the block means reaches the mean */
}

void gc_blocknet_merge(const gc_blocknet_t *net, const gc_blocknet_face_t *u, const gc_blocknet_face_t *d,
                       gc_blocknet_answer_t *answer) {
    /* u measures a s + b t, d measures a s - b t, s and t standard normal; written out so that nothing cancels */
    const float a = net->units[0];
    const float b = net->units[1];
    const float both = u->precision + d->precision;
    const float cross = 2.0f * u->precision * d->precision;
    const float det = 1.0f + (a * a + b * b) * both + 2.0f * a * a * b * b * cross;
    const float s = a * (u->precision * u->mean + d->precision * d->mean + b * b * cross * (u->mean + d->mean)) / det;
    const float t = b * (u->precision * u->mean - d->precision * d->mean + a * a * cross * (u->mean - d->mean)) / det;
    answer->scale = net->mean[0] + net->sd[0] * s;
    answer->bias_dps = net->mean[1] + net->sd[1] * t;
    answer->scale_sd = (float)((double)net->sd[0] * sqrt((double)(1.0f + b * b * both) / (double)det));
    answer->bias_sd_dps = (float)((double)net->sd[1] * sqrt((double)(1.0f + a * a * both) / (double)det));
    answer->clipped = u->clipped || d->clipped;
}

int gc_blocknet_run(const gc_blocknet_t *net, const float *up, const float *down, unsigned stage, float w_up_dps,
                    float w_down_dps, gc_blocknet_answer_t *answer) {
    gc_blocknet_face_t u, d;
    int error = gc_blocknet_face(net, up, stage, 0, w_up_dps, &u);
    if (error == GC_OK) {
        error = gc_blocknet_face(net, down, stage, 1, w_down_dps, &d);
    }
    if (error == GC_OK) {
        gc_blocknet_merge(net, &u, &d, answer);
    }
    return error;
}
