#include "gc_convnet_layers.h"

#if GC_NET_FIXED

#include <math.h>

/* Right shifts of negative numbers round down: every compiler of these CPUs shifts the sign in. */
static int32_t leaky(int32_t y, int32_t leak) {
    return y < 0 ? (y * leak + (1 << 14)) >> 15 : y;
}

static int32_t times_gain(int32_t sum, int32_t gain) {
    return (int32_t)(((int64_t)sum * gain) >> 32);
}

void gc_convnet_set_columns(const gc_convnet_t *net, gc_convnet_work_t *work, const int64_t *off, double gain) {
    const double wanted = gain * (double)net->columns_a_unit * 4294967296.0;
    const int64_t whole = fabs(wanted) < 9e18 ? (int64_t)wanted : 0; /* so large only if all columns are zero */
    const uint32_t n = gc_convnet_columns(net, work->stage);
    for (uint32_t i = 0; i < n; i++) {
        work->columns[i] = (int32_t)((off[i] * whole + ((int64_t)1 << 31)) >> 32);
    }
}

static uint32_t least(uint32_t a, uint32_t b) {
    return a < b ? a : b;
}

/* Computes y [times][outputs] of a layer from n inputs each time, `step` apart; rows of codes are `stride` apart. Four outputs are
 * summed together, so that an input is loaded once for four products; of fewer than four the last is repeated. */
static void find_outputs(const gc_convnet_t *net, const gc_convnet_layer_t *layer, const int32_t *start, uint32_t stride,
                         const int32_t *x, uint32_t n, uint32_t step, uint32_t times, uint32_t outputs, int32_t *y) {
    const int32_t leak = net->leak;
    for (uint32_t a = 0; a < outputs; a += 4u) {
        const uint32_t b = least(a + 1u, outputs - 1u);
        const uint32_t c = least(a + 2u, outputs - 1u);
        const uint32_t d = least(a + 3u, outputs - 1u);
        for (uint32_t t = 0; t < times; t++) {
            const int32_t *input = x + t * step;
            const int8_t *code_a = layer->code + a * stride;
            const int8_t *code_b = layer->code + b * stride;
            const int8_t *code_c = layer->code + c * stride;
            const int8_t *code_d = layer->code + d * stride;
            int32_t sum_a = start[a];
            int32_t sum_b = start[b];
            int32_t sum_c = start[c];
            int32_t sum_d = start[d];
            for (const int32_t *end = input + n; input < end; input++) {
                sum_a += *code_a++ * *input;
                sum_b += *code_b++ * *input;
                sum_c += *code_c++ * *input;
                sum_d += *code_d++ * *input;
            }
            int32_t *out = y + t * outputs;
            out[a] = leaky(times_gain(sum_a, layer->gain[a]), leak);
            out[b] = leaky(times_gain(sum_b, layer->gain[b]), leak);
            out[c] = leaky(times_gain(sum_c, layer->gain[c]), leak);
            out[d] = leaky(times_gain(sum_d, layer->gain[d]), leak);
        }
    }
}

/* rows [times][channels]: each is replaced by its sum with those after it in the second convolution's pool. */
static void add_over_pool(const gc_convnet_t *net, uint32_t times, int32_t *rows) {
    const uint32_t channels = net->first.channels;
    const uint32_t sums = (times - net->second.pool + 1u) * channels;
    const uint32_t pooled = net->second.pool * channels;
    for (uint32_t i = 0; i < sums; i++) {
        int32_t sum = rows[i];
        for (uint32_t k = channels; k < pooled; k += channels) {
            sum += rows[i + k];
        }
        rows[i] = sum;
    }
}

static int32_t last_sum(const gc_convnet_t *net, uint32_t output, const int32_t *x) {
    const int8_t *code = net->last_layer.code + output * net->hidden;
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
    const uint32_t taps = channels * net->second.kernel;
    const int16_t *straight = net->straight + stage * gc_convnet_columns(net, GC_CONVNET_STAGES - 1u);
    int32_t fourth[GC_CONVNET_MAX_HIDDEN];
    int64_t line = 0;
    find_outputs(net, &net->first_layer, net->first_layer.start, net->first.kernel, work->columns, net->first.kernel, 1u,
                 first_times, channels, work->sums);
    add_over_pool(net, first_times, work->sums);
    find_outputs(net, &net->second_layer, net->second_layer.start, taps, work->sums, taps, net->second.pool * channels, times,
                 features, work->features);
    find_outputs(net, &net->third_layer, net->third_layer.start + stage * hidden, all, work->features, times * features, 0u, 1u,
                 hidden, work->third);
    find_outputs(net, &net->fourth_layer, net->fourth_layer.start, hidden, work->third, hidden, 0u, 1u, hidden, fourth);
    for (uint32_t i = 0; i < gc_convnet_columns(net, stage); i++) {
        line += (int64_t)straight[i] * work->columns[i];
    }
    work->out[0] = (float)line * net->straight_step[stage] + (float)last_sum(net, 0, fourth) * net->last_step[0];
    work->out[1] = (float)last_sum(net, 1, fourth) * net->last_step[1];
    return true;
}

#endif
