#include "gc_convnet_layers.h"

#if GC_NET_FIXED

#include <math.h>
#include <stddef.h>

#define AT_ONCE 4u /* outputs, so that an input is loaded once for as many products */

/* Right shifts of negative numbers round down: every compiler of these CPUs shifts the sign in. */
static int32_t leaky(int32_t y, int32_t leak) {
    return y < 0 ? (y * leak + (1 << 14)) >> 15 : y;
}

static int32_t output(int32_t sum, int32_t gain, int32_t leak) {
    return leaky((int32_t)(((int64_t)sum * gain) >> 32), leak);
}

void gc_convnet_set_columns(const gc_convnet_t *net, gc_convnet_work_t *work, const int64_t *off, double gain) {
    const double wanted = gain * (double)net->columns_a_unit * 4294967296.0;
    const int64_t whole = fabs(wanted) < 9e18 ? (int64_t)wanted : 0; /* so large only if all columns are zero */
    const uint32_t n = gc_convnet_columns(net, work->stage);
    for (uint32_t i = 0; i < n; i++) {
        work->columns[i] = (int16_t)((off[i] * whole + ((int64_t)1 << 31)) >> 32);
    }
}

static uint32_t least(uint32_t a, uint32_t b) {
    return a < b ? a : b;
}

/* The sums of the products of n inputs and the codes of four outputs. */
static inline void find_sums(int32_t sum[AT_ONCE], const gc_convnet_code_t *const code[AT_ONCE], const int16_t *x, uint32_t n) {
    const gc_convnet_code_t *code_a = code[0], *code_b = code[1], *code_c = code[2], *code_d = code[3];
    int32_t a = 0, b = 0, c = 0, d = 0;
#if GC_HAS_HALFWORDS
    for (const int16_t *end = x + (n & ~1u); x < end; x += 2) {
        const int16x2_t both = gc_halfwords_at(x);
        a = __smlad(gc_halfwords_at(code_a), both, a);
        b = __smlad(gc_halfwords_at(code_b), both, b);
        c = __smlad(gc_halfwords_at(code_c), both, c);
        d = __smlad(gc_halfwords_at(code_d), both, d);
        code_a += 2;
        code_b += 2;
        code_c += 2;
        code_d += 2;
    }
    n &= 1u;
#endif
    for (const int16_t *end = x + n; x < end; x++) {
        const int32_t input = *x;
        a += *code_a++ * input;
        b += *code_b++ * input;
        c += *code_c++ * input;
        d += *code_d++ * input;
    }
    sum[0] = a;
    sum[1] = b;
    sum[2] = c;
    sum[3] = d;
}

/* The same of inputs of 32 bits. */
static inline void find_wide_sums(int32_t sum[AT_ONCE], const gc_convnet_code_t *const code[AT_ONCE], const int32_t *x, uint32_t n) {
    const gc_convnet_code_t *code_a = code[0], *code_b = code[1], *code_c = code[2], *code_d = code[3];
    int32_t a = 0, b = 0, c = 0, d = 0;
    for (const int32_t *end = x + n; x < end; x++) {
        const int32_t input = *x;
        a += *code_a++ * input;
        b += *code_b++ * input;
        c += *code_c++ * input;
        d += *code_d++ * input;
    }
    sum[0] = a;
    sum[1] = b;
    sum[2] = c;
    sum[3] = d;
}

/* Computes y [times][channels] of a convolution from n inputs each time, `step` apart. Of fewer than four outputs that are left, the
 * last is computed more than once. */
static void convolve(const gc_convnet_layer_t *layer, int32_t leak, uint32_t channels, const int16_t *x, uint32_t n, uint32_t step,
                     uint32_t times, int16_t *y) {
    const int32_t *start = layer->start, *gain = layer->gain;
    for (uint32_t a = 0; a < channels; a += AT_ONCE) {
        const uint32_t b = least(a + 1u, channels - 1u), c = least(a + 2u, channels - 1u), d = least(a + 3u, channels - 1u);
        const gc_convnet_code_t *const code[AT_ONCE] = {layer->code + a * n, layer->code + b * n, layer->code + c * n,
                                                        layer->code + d * n};
        const int16_t *input = x;
        int16_t *out = y;
        for (uint32_t t = 0; t < times; t++) {
            int32_t sum[AT_ONCE];
            find_sums(sum, code, input, n);
            out[a] = (int16_t)output(start[a] + sum[0], gain[a], leak);
            out[b] = (int16_t)output(start[b] + sum[1], gain[b], leak);
            out[c] = (int16_t)output(start[c] + sum[2], gain[c], leak);
            out[d] = (int16_t)output(start[d] + sum[3], gain[d], leak);
            input += step;
            out += channels;
        }
    }
}

/* Computes a dense layer from n inputs of 16 bits, or of 32 where x is NULL; rows of codes are `stride` apart. */
static void connect(const gc_convnet_layer_t *layer, int32_t leak, uint32_t outputs, const int32_t *start, uint32_t stride,
                    const int16_t *x, const int32_t *wide, uint32_t n, int32_t *y) {
    const int32_t *gain = layer->gain;
    for (uint32_t a = 0; a < outputs; a += AT_ONCE) {
        const uint32_t b = least(a + 1u, outputs - 1u), c = least(a + 2u, outputs - 1u), d = least(a + 3u, outputs - 1u);
        const gc_convnet_code_t *const code[AT_ONCE] = {layer->code + a * stride, layer->code + b * stride,
                                                        layer->code + c * stride, layer->code + d * stride};
        int32_t sum[AT_ONCE];
        if (x != NULL) {
            find_sums(sum, code, x, n);
        } else {
            find_wide_sums(sum, code, wide, n);
        }
        y[a] = output(start[a] + sum[0], gain[a], leak);
        y[b] = output(start[b] + sum[1], gain[b], leak);
        y[c] = output(start[c] + sum[2], gain[c], leak);
        y[d] = output(start[d] + sum[3], gain[d], leak);
    }
}

/* rows [times][channels]: each is replaced by its sum with those after it in the second convolution's pool. */
static void add_over_pool(const gc_convnet_t *net, uint32_t times, int16_t *rows) {
    const uint32_t channels = net->first.channels;
    const uint32_t sums = (times - net->second.pool + 1u) * channels;
    const uint32_t pooled = net->second.pool * channels;
    for (uint32_t i = 0; i < sums; i++) {
        int32_t sum = rows[i];
        for (uint32_t k = channels; k < pooled; k += channels) {
            sum += rows[i + k];
        }
        rows[i] = (int16_t)sum;
    }
}

static int32_t last_sum(const gc_convnet_t *net, uint32_t output, const int32_t *x) {
    const gc_convnet_code_t *code = net->last_layer.code + output * net->hidden;
    int32_t sum = net->last_layer.start[output];
    for (uint32_t i = 0; i < net->hidden; i++) {
        sum += code[i] * x[i];
    }
    return sum;
}

bool gc_convnet_next_part(const gc_convnet_t *net, gc_convnet_work_t *work) {
    const unsigned stage = work->stage;
    const uint32_t channels = net->first.channels;
    const uint32_t features = net->second.channels;
    const uint32_t hidden = net->hidden;
    const uint32_t first_times = gc_convnet_first_times(net, stage);
    const uint32_t times = gc_convnet_second_times(net, stage);
    const uint32_t all = gc_convnet_second_times(net, GC_CONVNET_STAGES - 1u) * features;
    const int32_t leak = net->leak;
    const int16_t *straight = net->straight + stage * gc_convnet_columns(net, GC_CONVNET_STAGES - 1u);
    int32_t fourth[GC_CONVNET_MAX_HIDDEN];
    int64_t line = 0;
    convolve(&net->first_layer, leak, channels, work->columns, net->first.kernel, 1u, first_times, work->sums);
    add_over_pool(net, first_times, work->sums);
    convolve(&net->second_layer, leak, features, work->sums, channels * net->second.kernel, net->second.pool * channels, times,
             work->features);
    connect(&net->third_layer, leak, hidden, net->third_layer.start + stage * hidden, all, work->features, NULL, times * features,
            work->third);
    connect(&net->fourth_layer, leak, hidden, net->fourth_layer.start, hidden, NULL, work->third, hidden, fourth);
    for (uint32_t i = 0; i < gc_convnet_columns(net, stage); i++) {
        line += (int64_t)straight[i] * work->columns[i];
    }
    work->out[0] = (float)line * net->straight_step[stage] + (float)last_sum(net, 0, fourth) * net->last_step[0];
    work->out[1] = (float)last_sum(net, 1, fourth) * net->last_step[1];
    return true;
}

#endif
