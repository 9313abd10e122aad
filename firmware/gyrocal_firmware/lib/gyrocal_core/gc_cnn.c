#include "gc_cnn.h"

#include <float.h>
#include <string.h>

#include "gc_error.h"
#include "gc_math.h"

#define RATE_TOLERANCE 0.03f /* relative difference from the trained rate that is accepted; chosen by judgement */

static uint32_t bits_of(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

/* Works on the bits, with one integer comparison if nothing is clipped, also without an FPU. NaN stays NaN. */
static float clip(float x, float limit, uint32_t limit_bits) {
    uint32_t bits = bits_of(x), size = bits & 0x7FFFFFFFu;
    if (size <= limit_bits || size > 0x7F800000u) {
        return x;
    }
    return bits == size ? limit : -limit;
}

/* LeakyReLU comes after the pool, so convolution and pool are one linear map: a convolution of sums over the pool.
 * sums[k * GC_CNN_BLOCK + t]: sum over the pool that tap k of column t sees. */
static void pool_sums(const gc_cnn_conv_t *conv, const float *in, float limit, float *sums) {
    uint32_t limit_bits = bits_of(limit);
    for (uint32_t t = 0; t < GC_CNN_BLOCK; t++, in += conv->pool) {
        float sum = 0.0f;
        for (uint32_t i = 0; i < conv->pool; i++) {
            sum += clip(in[i], limit, limit_bits);
        }
        sums[t] = sum;
        for (uint32_t k = 1; k < conv->kernel; k++) {
            sum += clip(in[conv->pool + k - 1], limit, limit_bits) - clip(in[k - 1], limit, limit_bits);
            sums[k * GC_CNN_BLOCK + t] = sum;
        }
    }
}

/* Adds to acc[channels][columns] the convolution of in[channels_in][stride], clipped to +-limit. */
static void convolve(const gc_cnn_conv_t *conv, const int8_t *code, uint32_t code_stride, const float *in,
                     uint32_t channels_in, uint32_t stride, float limit, float *sums, float *acc) {
    uint32_t taps = channels_in * conv->kernel;
    for (uint32_t first = 0; first < conv->columns; first += GC_CNN_BLOCK) {
        for (uint32_t c = 0; c < channels_in; c++) {
            pool_sums(conv, in + c * stride + first * conv->pool, limit, sums + c * conv->kernel * GC_CNN_BLOCK);
        }
        for (uint32_t c = 0; c < conv->channels; c++) {
            const int8_t *row = code + c * code_stride;
            const float *x = sums;
            float *out = acc + c * conv->columns + first;
            float y0 = out[0], y1 = out[1], y2 = out[2], y3 = out[3];
            for (uint32_t i = 0; i < taps; i++, x += GC_CNN_BLOCK) {
                float w = (float)row[i];
                y0 += w * x[0];
                y1 += w * x[1];
                y2 += w * x[2];
                y3 += w * x[3];
            }
            out[0] = y0, out[1] = y1, out[2] = y2, out[3] = y3;
        }
    }
}

static void activate(const gc_cnn_conv_t *conv, const gc_cnn_layer_t *layer, float leak, float *acc) {
    for (uint32_t c = 0; c < conv->channels; c++) {
        for (uint32_t t = 0; t < conv->columns; t++, acc++) {
            float y = layer->bias[c] + layer->step[c] * *acc;
            *acc = y < 0.0f ? leak * y : y;
        }
    }
}

float gc_cnn_neuron(const gc_cnn_layer_t *layer, uint32_t i, const float *in, uint32_t n) {
    const int8_t *row = layer->code + i * n;
    float sum = 0.0f;
    for (uint32_t k = 0; k < n; k++) {
        sum += (float)row[k] * in[k];
    }
    return layer->bias[i] + layer->step[i] * sum;
}

bool gc_cnn_same_rate(float w_dps, float trained_dps) {
    float off = (w_dps - trained_dps) / trained_dps;
    return off >= -RATE_TOLERANCE && off <= RATE_TOLERANCE;
}

int gc_cnn_run(const gc_cnn_net_t *net, const float *up, const float *down, float w_up_dps, float w_down_dps,
               float *scratch, float *out) {
    if (!gc_cnn_same_rate(w_up_dps, net->table_dps) || !gc_cnn_same_rate(w_down_dps, -net->table_dps)) {
        return GC_E_NET_RATE;
    }
    if (net->window == 0u) {
        return GC_E_NET_WINDOW;
    }
    const gc_cnn_conv_t *head = &net->head, *combined = &net->combined;
    uint32_t head_size = head->channels * head->columns, combined_size = combined->channels * combined->columns;
    uint32_t head_taps = head->channels * combined->kernel;
    float *joined = scratch, *rows = joined + combined_size, *sums = rows + head_size, *hidden = rows;

    memset(joined, 0, combined_size * sizeof *joined);
    for (uint32_t face = 0; face < 2; face++) {
        const gc_cnn_layer_t *layer = face ? &net->down : &net->up;
        memset(rows, 0, head_size * sizeof *rows);
        convolve(head, layer->code, head->kernel, face ? down : up, 1, 0, net->clip_dps, sums, rows);
        activate(head, layer, net->leak, rows);
        convolve(combined, net->combined_conv.code + face * head_taps, 2 * head_taps, rows, head->channels,
                 head->columns, FLT_MAX, sums, joined);
    }
    activate(combined, &net->combined_conv, net->leak, joined);

    for (uint32_t i = 0; i < net->hidden; i++) {
        hidden[i] = gc_tanh(gc_cnn_neuron(&net->fc1, i, joined, combined_size));
    }
    if (hidden[0] != hidden[0]) {
        return GC_E_NET_INPUT; /* a NaN among the samples has reached every neuron */
    }
    for (uint32_t i = 0; i < net->outputs; i++) {
        out[i] = gc_cnn_neuron(&net->fc2, i, hidden, net->hidden);
    }
    return 0;
}
