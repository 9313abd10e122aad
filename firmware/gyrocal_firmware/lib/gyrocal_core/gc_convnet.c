#include "gc_convnet.h"

#include <math.h>
#include <stddef.h>

#include "gc_error.h"
#include "gc_math.h"

#define SECOND_A_PART 6u /* channels of the second layer that are done at once, */
#define THIRD_A_PART 12u /* neurons of the third */

static uint32_t columns_of(const gc_convnet_t *net, unsigned stage) {
    return net->stage_columns * (stage + 1u);
}

uint32_t gc_convnet_samples(const gc_convnet_t *net, unsigned stage) {
    return net->pool * columns_of(net, stage);
}

static uint32_t first_times(const gc_convnet_t *net, unsigned stage) {
    return columns_of(net, stage) - net->first.kernel + 1u;
}

static uint32_t second_times(const gc_convnet_t *net, unsigned stage) {
    return (first_times(net, stage) - net->second.kernel + 1u) / net->second.pool;
}

static bool fits(const gc_convnet_t *net) {
    const unsigned last = GC_CONVNET_STAGES - 1u;
    return columns_of(net, last) <= GC_CONVNET_MAX_COLUMNS && net->hidden <= GC_CONVNET_MAX_HIDDEN &&
           net->first.channels * first_times(net, last) <= GC_CONVNET_MAX_ROWS &&
           net->second.channels * second_times(net, last) <= GC_CONVNET_MAX_FEATURES &&
           net->first.kernel <= GC_CONVNET_MAX_TAPS && net->first.channels * net->second.kernel <= GC_CONVNET_MAX_TAPS &&
           net->first.channels * net->second.kernel * second_times(net, last) <= GC_CONVNET_MAX_SUMS;
}

/* columns: means of the counts less the mean of all of them, in units; the mean in counts. GC_OK or GC_E_NET_RANGE. */
static int find_columns(const gc_convnet_t *net, const int16_t *counts, unsigned stage, double sign, double lsb_dps,
                        float *columns, double *mean) {
    const uint32_t n_columns = columns_of(net, stage);
    const int32_t pool = (int32_t)net->pool;
    const double n = (double)gc_convnet_samples(net, stage);
    int32_t sums[GC_CONVNET_MAX_COLUMNS];
    int32_t total = 0;
    int32_t off_column = 0; /* the largest |sample - column|, and below |column - mean|, in counts times a divisor */
    double off_mean = 0.0;
    for (uint32_t i = 0; i < n_columns; i++, counts += pool) {
        int32_t sum = 0;
        int32_t least = counts[0];
        int32_t most = counts[0];
        for (int32_t k = 0; k < pool; k++) {
            const int32_t count = counts[k];
            sum += count;
            least = count < least ? count : least;
            most = count > most ? count : most;
        }
        off_column = most * pool - sum > off_column ? most * pool - sum : off_column;
        off_column = sum - least * pool > off_column ? sum - least * pool : off_column;
        sums[i] = sum;
        total += sum;
    }
    const double gain = sign * lsb_dps / (n * (double)net->pool * (double)net->unit_dps);
    for (uint32_t i = 0; i < n_columns; i++) {
        const double off = (double)sums[i] * n - (double)total * (double)pool; /* exact */
        off_mean = fabs(off) > off_mean ? fabs(off) : off_mean;
        columns[i] = (float)(gain * off);
    }
    *mean = (double)total / n;
    const bool in_range = lsb_dps * (double)off_column <= (double)net->sample_range_dps * (double)pool &&
                          lsb_dps * off_mean <= (double)net->column_range_dps * (double)pool * n;
    return in_range ? GC_OK : GC_E_NET_RANGE;
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
    const uint32_t row_times = first_times(net, stage);
    const uint32_t taps = net->first.channels * conv->kernel;
    for (uint32_t t = 0; t < second_times(net, stage); t++) {
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
    convolve_columns(net, work->columns, first_times(net, stage), rows);
    add_over_pool(net, rows, stage, work->sums);
}

static uint32_t least(uint32_t a, uint32_t b) {
    return a < b ? a : b;
}

/* features [times][channels] */
static void go_through_second(const gc_convnet_t *net, unsigned stage, gc_convnet_work_t *work) {
    const gc_cnn_layer_t *layer = &net->second_layer;
    const uint32_t channels = net->second.channels;
    const uint32_t taps = net->first.channels * net->second.kernel;
    const uint32_t until = least(work->channels + SECOND_A_PART, channels);
    float weight[GC_CONVNET_MAX_TAPS];
    for (uint32_t c = work->channels; c < until; c++) {
        unpack(layer->code + c * taps, taps, weight);
        for (uint32_t t = 0; t < second_times(net, stage); t++) {
            const float sum = dot_unpacked(weight, work->sums + t * taps, taps);
            work->features[t * channels + c] = leaky(layer->bias[c] + layer->step[c] * sum, net->leak);
        }
    }
    work->channels = until;
}

static void go_through_third(const gc_convnet_t *net, unsigned stage, gc_convnet_work_t *work) {
    const gc_cnn_layer_t *layer = &net->third_layer;
    const uint32_t all = second_times(net, GC_CONVNET_STAGES - 1u) * net->second.channels;
    const uint32_t seen = second_times(net, stage) * net->second.channels;
    const uint32_t until = least(work->hidden + THIRD_A_PART, net->hidden);
    for (uint32_t i = work->hidden; i < until; i++) {
        const float sum = dot(layer->code + i * all, work->features, seen);
        work->third[i] = leaky(layer->bias[stage * net->hidden + i] + layer->step[i] * sum, net->leak);
    }
    work->hidden = until;
}

static float within(float x, float limit) {
    return x > limit ? limit : x < -limit ? -limit : x;
}

static void conclude(const gc_convnet_t *net, unsigned stage, gc_convnet_work_t *work) {
    const float *straight = net->straight + stage * columns_of(net, GC_CONVNET_STAGES - 1u);
    float fourth[GC_CONVNET_MAX_HIDDEN];
    float line = 0.0f;
    for (uint32_t i = 0; i < net->hidden; i++) {
        fourth[i] = leaky(neuron(&net->fourth_layer, i, work->third, net->hidden), net->leak);
    }
    for (uint32_t i = 0; i < columns_of(net, stage); i++) {
        line += straight[i] * work->columns[i];
    }
    const float log_precision = neuron(&net->last_layer, 1, fourth, net->hidden);
    work->out[0] = line + neuron(&net->last_layer, 0, fourth, net->hidden);
    work->out[1] = within(log_precision, net->log_precision);
}

int gc_convnet_begin(const gc_convnet_t *net, const int16_t *counts, unsigned stage, double lsb_dps, double w_dps,
                     gc_convnet_work_t *work) {
    const double sign = w_dps < 0.0 ? -1.0 : 1.0;
    if (!gc_cnn_same_rate((float)(sign * w_dps), net->table_dps)) {
        return GC_E_NET_RATE;
    }
    if (!fits(net)) {
        return GC_E_NET_MEMORY;
    }
    if (!(lsb_dps > 0.0)) {
        return GC_E_NET_RANGE;
    }
    work->convolved = false;
    work->channels = 0;
    work->hidden = 0;
    work->stage = stage;
    work->w_dps = w_dps;
    double mean = 0.0;
    const int error = find_columns(net, counts, stage, sign, lsb_dps, work->columns, &mean);
    work->mean_dps = lsb_dps * mean - w_dps;
    return error;
}

bool gc_convnet_go_on(const gc_convnet_t *net, gc_convnet_work_t *work, gc_convnet_face_t *face) {
    if (!work->convolved) {
        go_through_first(net, work->stage, work);
        work->convolved = true;
    } else if (work->channels < net->second.channels) {
        go_through_second(net, work->stage, work);
    } else if (work->hidden < net->hidden) {
        go_through_third(net, work->stage, work);
    } else {
        conclude(net, work->stage, work);
        const double unit_dps = (double)net->unit_dps;
        const double sign = work->w_dps < 0.0 ? -1.0 : 1.0;
        face->w_dps = work->w_dps;
        face->u_dps = work->mean_dps + sign * unit_dps * (double)work->out[0];
        face->precision = (double)gc_exp(work->out[1]) / (unit_dps * unit_dps);
        return true;
    }
    return false;
}

int gc_convnet_face(const gc_convnet_t *net, const int16_t *counts, unsigned stage, double lsb_dps, double w_dps,
                    gc_convnet_work_t *work, gc_convnet_face_t *face) {
    const int error = gc_convnet_begin(net, counts, stage, lsb_dps, w_dps, work);
    while (error == GC_OK && !gc_convnet_go_on(net, work, face)) {
    }
    return error;
}

void gc_convnet_merge(const gc_calibration_t *calibration, const gc_convnet_face_t *up, const gc_convnet_face_t *down,
                      gc_answer_t *answer) {
    double mean[2] = {0.0, 0.0};           /* mean of the prior: bias, scale */
    double root[3] = {0.0, 0.0, 0.0};      /* square root of its information: [0 1; . 2] */
    if (calibration != NULL && calibration->prior_mean != NULL && calibration->prior_sqrt_information != NULL) {
        /* the last triangle of a square root is the marginal information of the last parameters */
        const unsigned n = calibration->n_run_columns + calibration->n_shared_columns + 2u;
        const double *last = calibration->prior_sqrt_information + (size_t)n * n - 1u;
        mean[0] = calibration->prior_mean[n - 2u];
        mean[1] = calibration->prior_mean[n - 1u];
        root[0] = last[-(ptrdiff_t)n - 1];
        root[1] = last[-(ptrdiff_t)n];
        root[2] = last[0];
    }
    const double of_bias = root[0] * root[0];
    const double of_both = root[0] * root[1];
    const double of_scale = root[1] * root[1] + root[2] * root[2];
    const double u = up->precision;
    const double d = down->precision;
    const double bb = of_bias + u + d;
    const double bs = of_both + u * up->w_dps + d * down->w_dps;
    const double ss = of_scale + u * up->w_dps * up->w_dps + d * down->w_dps * down->w_dps;
    const double b = of_bias * mean[0] + of_both * mean[1] + u * up->u_dps + d * down->u_dps;
    const double s = of_both * mean[0] + of_scale * mean[1] + u * up->w_dps * up->u_dps + d * down->w_dps * down->u_dps;
    const double det = bb * ss - bs * bs; /* positive: the true rates differ */
    answer->bias_dps = (ss * b - bs * s) / det;
    answer->scale = (bb * s - bs * b) / det;
    answer->bias_se_dps = sqrt(ss / det);
    answer->scale_se = sqrt(bb / det);
}
