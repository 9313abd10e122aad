#include "gc_convnet.h"

#include <math.h>
#include <stddef.h>

#include "gc_error.h"
#include "gc_math.h"

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
           net->second.channels * second_times(net, last) <= GC_CONVNET_MAX_FEATURES;
}

int gc_convnet_columns(const gc_convnet_t *net, const int16_t *counts, unsigned stage, double lsb_dps, double sign, float *columns,
                       double *mean) {
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

/* rows [channels][times] */
static void convolve_columns(const gc_convnet_t *net, const float *columns, uint32_t times, float *rows) {
    const gc_cnn_conv_t *conv = &net->first;
    const gc_cnn_layer_t *layer = &net->first_layer;
    for (uint32_t c = 0; c < conv->channels; c++) {
        const int8_t *code = layer->code + c * conv->kernel;
        for (uint32_t t = 0; t < times; t++) {
            float sum = 0.0f;
            for (uint32_t k = 0; k < conv->kernel; k++) {
                sum += (float)code[k] * columns[t + k];
            }
            *rows++ = leaky(layer->bias[c] + layer->step[c] * sum, net->leak);
        }
    }
}

/* Convolution and pool at once, of sums over the pool; features [times][channels]. */
static void convolve_rows(const gc_convnet_t *net, const float *rows, uint32_t row_times, uint32_t times, float *features) {
    const gc_cnn_conv_t *conv = &net->second;
    const gc_cnn_layer_t *layer = &net->second_layer;
    const uint32_t taps = net->first.channels * conv->kernel;
    float sums[GC_CONVNET_MAX_FEATURES];
    for (uint32_t t = 0; t < times; t++) {
        for (uint32_t i = 0; i < taps; i++) {
            const float *row = rows + i / conv->kernel * row_times + t * conv->pool + i % conv->kernel;
            float sum = 0.0f;
            for (uint32_t p = 0; p < conv->pool; p++) {
                sum += row[p];
            }
            sums[i] = sum;
        }
        for (uint32_t c = 0; c < conv->channels; c++) {
            *features++ = leaky(gc_cnn_neuron(layer, c, sums, taps), net->leak);
        }
    }
}

int gc_convnet_infer(const gc_convnet_t *net, const float *columns, unsigned stage, float out[2]) {
    float rows[GC_CONVNET_MAX_ROWS];
    float features[GC_CONVNET_MAX_FEATURES];
    float third[GC_CONVNET_MAX_HIDDEN];
    float fourth[GC_CONVNET_MAX_HIDDEN];
    if (!fits(net) || net->first.channels * net->second.kernel > GC_CONVNET_MAX_FEATURES) {
        return GC_E_NET_MEMORY;
    }
    const uint32_t all = second_times(net, GC_CONVNET_STAGES - 1u) * net->second.channels;
    const uint32_t seen = second_times(net, stage) * net->second.channels;
    convolve_columns(net, columns, first_times(net, stage), rows);
    convolve_rows(net, rows, first_times(net, stage), second_times(net, stage), features);
    for (uint32_t i = 0; i < net->hidden; i++) {
        const int8_t *code = net->third_layer.code + i * all;
        float sum = 0.0f;
        for (uint32_t k = 0; k < seen; k++) {
            sum += (float)code[k] * features[k];
        }
        third[i] = leaky(net->third_layer.bias[stage * net->hidden + i] + net->third_layer.step[i] * sum, net->leak);
    }
    for (uint32_t i = 0; i < net->hidden; i++) {
        fourth[i] = leaky(gc_cnn_neuron(&net->fourth_layer, i, third, net->hidden), net->leak);
    }
    const float *straight = net->straight + stage * columns_of(net, GC_CONVNET_STAGES - 1u);
    float line = 0.0f;
    for (uint32_t i = 0; i < columns_of(net, stage); i++) {
        line += straight[i] * columns[i];
    }
    const float log_precision = gc_cnn_neuron(&net->last_layer, 1, fourth, net->hidden);
    out[0] = line + gc_cnn_neuron(&net->last_layer, 0, fourth, net->hidden);
    out[1] = log_precision > net->log_precision    ? net->log_precision
             : log_precision < -net->log_precision ? -net->log_precision
                                                   : log_precision;
    return GC_OK;
}

int gc_convnet_face(const gc_convnet_t *net, const int16_t *counts, unsigned stage, double lsb_dps, double w_dps,
                    gc_convnet_face_t *face) {
    const double sign = w_dps < 0.0 ? -1.0 : 1.0;
    float columns[GC_CONVNET_MAX_COLUMNS];
    float out[2];
    double mean;
    if (!gc_cnn_same_rate((float)(sign * w_dps), net->table_dps)) {
        return GC_E_NET_RATE;
    }
    if (!fits(net)) {
        return GC_E_NET_MEMORY;
    }
    int error = gc_convnet_columns(net, counts, stage, lsb_dps, sign, columns, &mean);
    if (error == GC_OK) {
        error = gc_convnet_infer(net, columns, stage, out);
    }
    if (error == GC_OK) {
        const double unit_dps = (double)net->unit_dps;
        face->w_dps = w_dps;
        face->u_dps = lsb_dps * mean - w_dps + sign * unit_dps * (double)out[0];
        face->precision = (double)gc_exp(out[1]) / (unit_dps * unit_dps);
    }
    return error;
}

void gc_convnet_merge(const gc_calibration_t *calibration, const gc_convnet_face_t *up, const gc_convnet_face_t *down,
                      gc_answer_t *answer) {
    double mean[2] = {0.0, 0.0};           /* of the prior: bias, scale */
    double root[3] = {0.0, 0.0, 0.0};      /* square root of its information: [0 1; . 2] */
    if (calibration != NULL && calibration->prior_mean != NULL && calibration->prior_sqrt_information != NULL) {
        /* the last triangle of a square root holds what is known of the last parameters whatever the others are */
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
