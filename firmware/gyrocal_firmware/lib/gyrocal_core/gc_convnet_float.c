#include "gc_convnet_layers.h"

#if !GC_NET_FIXED

#define SECOND_A_PART 6u /* channels of the second layer that are done at once, */
#define THIRD_A_PART 12u /* neurons of the third */

void gc_convnet_set_columns(const gc_convnet_t *net, gc_convnet_work_t *work, const int64_t *off, double gain) {
    for (uint32_t i = 0; i < gc_convnet_columns(net, work->stage); i++) {
        work->columns[i] = (float)(gain * (double)off[i]);
    }
}

static float leaky(float y, float leak) {
    return y < 0.0f ? leak * y : y;
}

/* Four sums of every fourth product: partial sums stay smaller than in one, and so does their rounding. */
static float dot(const int8_t *code, const float *x, uint32_t n) {
    float sum[4] = {0.0f, 0.0f, 0.0f, 0.0f};
    uint32_t i = 0;
    for (; i + 4u <= n; i += 4u) {
        sum[0] += (float)code[i] * x[i];
        sum[1] += (float)code[i + 1u] * x[i + 1u];
        sum[2] += (float)code[i + 2u] * x[i + 2u];
        sum[3] += (float)code[i + 3u] * x[i + 3u];
    }
    for (; i < n; i++) {
        sum[0] += (float)code[i] * x[i];
    }
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

static float neuron(const gc_cnn_layer_t *layer, uint32_t i, const float *x, uint32_t n) {
    return layer->bias[i] + layer->step[i] * dot(layer->code + i * n, x, n);
}

/* The weights of a kernel, unpacked once for all times. */
static void unpack(const int8_t *code, uint32_t n, float *weight) {
    for (uint32_t i = 0; i < n; i++) {
        weight[i] = (float)code[i];
    }
}

static float dot_unpacked(const float *weight, const float *x, uint32_t n) {
    float sum[4] = {0.0f, 0.0f, 0.0f, 0.0f};
    uint32_t i = 0;
    for (; i + 4u <= n; i += 4u) {
        sum[0] += weight[i] * x[i];
        sum[1] += weight[i + 1u] * x[i + 1u];
        sum[2] += weight[i + 2u] * x[i + 2u];
        sum[3] += weight[i + 3u] * x[i + 3u];
    }
    for (; i < n; i++) {
        sum[0] += weight[i] * x[i];
    }
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/* rows [channels][times] */
static void convolve_columns(const gc_convnet_t *net, const float *columns, uint32_t times, float *rows) {
    const gc_cnn_layer_t *layer = &net->first_layer;
    float weight[GC_CONVNET_MAX_TAPS];
    for (uint32_t c = 0; c < net->first.channels; c++) {
        unpack(layer->code + c * net->first.kernel, net->first.kernel, weight);
        for (uint32_t t = 0; t < times; t++) {
            const float sum = dot_unpacked(weight, columns + t, net->first.kernel);
            *rows++ = leaky(layer->bias[c] + layer->step[c] * sum, net->leak);
        }
    }
}

/* The second convolution and its pool are one: a convolution of sums [times][taps] over the pool. */
static void add_over_pool(const gc_convnet_t *net, const float *rows, unsigned stage, float *sums) {
    const gc_cnn_conv_t *conv = &net->second;
    const uint32_t row_times = gc_convnet_first_times(net, stage);
    const uint32_t taps = net->first.channels * conv->kernel;
    for (uint32_t t = 0; t < gc_convnet_second_times(net, stage); t++) {
        for (uint32_t i = 0; i < taps; i++) {
            const float *row = rows + i / conv->kernel * row_times + t * conv->pool + i % conv->kernel;
            float sum = 0.0f;
            for (uint32_t p = 0; p < conv->pool; p++) {
                sum += row[p]; /* NOLINT(clang-analyzer-core.uninitialized.Assign): gyrocal_check bounds what is read */
            }
            *sums++ = sum;
        }
    }
}

static void go_through_first(const gc_convnet_t *net, unsigned stage, gc_convnet_work_t *work) {
    float rows[GC_CONVNET_MAX_ROWS];
    convolve_columns(net, work->columns, gc_convnet_first_times(net, stage), rows);
    add_over_pool(net, rows, stage, work->sums);
}

static uint32_t least(uint32_t a, uint32_t b) {
    return a < b ? a : b;
}

/* features [times][channels] */
static void go_through_second(const gc_convnet_t *net, unsigned stage, uint32_t from, gc_convnet_work_t *work) {
    const gc_cnn_layer_t *layer = &net->second_layer;
    const uint32_t channels = net->second.channels;
    const uint32_t taps = net->first.channels * net->second.kernel;
    const uint32_t until = least(from + SECOND_A_PART, channels);
    float weight[GC_CONVNET_MAX_TAPS];
    for (uint32_t c = from; c < until; c++) {
        unpack(layer->code + c * taps, taps, weight);
        for (uint32_t t = 0; t < gc_convnet_second_times(net, stage); t++) {
            const float sum = dot_unpacked(weight, work->sums + t * taps, taps);
            work->features[t * channels + c] = leaky(layer->bias[c] + layer->step[c] * sum, net->leak);
        }
    }
}

static void go_through_third(const gc_convnet_t *net, unsigned stage, uint32_t from, gc_convnet_work_t *work) {
    const gc_cnn_layer_t *layer = &net->third_layer;
    const uint32_t all = gc_convnet_second_times(net, GC_CONVNET_STAGES - 1u) * net->second.channels;
    const uint32_t seen = gc_convnet_second_times(net, stage) * net->second.channels;
    const uint32_t until = least(from + THIRD_A_PART, net->hidden);
    for (uint32_t i = from; i < until; i++) {
        const float sum = dot(layer->code + i * all, work->features, seen);
        work->third[i] = leaky(layer->bias[stage * net->hidden + i] + layer->step[i] * sum, net->leak);
    }
}

static void conclude(const gc_convnet_t *net, unsigned stage, gc_convnet_work_t *work) {
    const float *straight = net->straight + stage * gc_convnet_columns(net, GC_CONVNET_STAGES - 1u);
    float fourth[GC_CONVNET_MAX_HIDDEN];
    float line = 0.0f;
    for (uint32_t i = 0; i < net->hidden; i++) {
        fourth[i] = leaky(neuron(&net->fourth_layer, i, work->third, net->hidden), net->leak);
    }
    for (uint32_t i = 0; i < gc_convnet_columns(net, stage); i++) {
        line += straight[i] * work->columns[i];
    }
    work->out[0] = line + neuron(&net->last_layer, 0, fourth, net->hidden);
    work->out[1] = neuron(&net->last_layer, 1, fourth, net->hidden);
}

bool gc_convnet_next_part(const gc_convnet_t *net, gc_convnet_work_t *work) {
    const uint32_t seconds = (net->second.channels + SECOND_A_PART - 1u) / SECOND_A_PART;
    const uint32_t thirds = (net->hidden + THIRD_A_PART - 1u) / THIRD_A_PART;
    const uint32_t part = work->parts++;
    if (part == 0u) {
        go_through_first(net, work->stage, work);
    } else if (part <= seconds) {
        go_through_second(net, work->stage, (part - 1u) * SECOND_A_PART, work);
    } else if (part <= seconds + thirds) {
        go_through_third(net, work->stage, (part - 1u - seconds) * THIRD_A_PART, work);
    } else {
        conclude(net, work->stage, work);
        return true;
    }
    return false;
}

#endif
