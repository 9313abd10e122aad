/* The paper's network (Fig. 2) on two windows of rate, as one fused pass.
 *
 * A network is a table in a generated header (include/weights.h, written by `gyrocal export`), reached by pointer:
 *
 *     #include "weights.h"                      // static const gc_cnn_net_t gc_net;  GC_NET_SCRATCH_FLOATS
 *     float scratch[GC_NET_SCRATCH_FLOATS], out[2];
 *     int error = gc_cnn_run(&gc_net, up, down, 78.0f, -78.0f, scratch, out);
 *
 * The numbers are those of the quantised ONNX graph that the header was made from (int8 weights, float32 activations)
 * to float rounding, and the same bits on every CPU: the order of sums is fixed.
 */
#ifndef GC_CNN_H
#define GC_CNN_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* weight = step[out] * code, codes row-major [out][in][kernel]; before a pool, step is divided by the pool's length. */
typedef struct gc_cnn_layer {
    const int8_t *code;
    const float *step;
    const float *bias;
} gc_cnn_layer_t;

/* A convolution over time, followed by the mean over `pool` neighbours and LeakyReLU. */
typedef struct gc_cnn_conv {
    uint32_t channels;
    uint32_t kernel;
    uint32_t pool;
    uint32_t columns; /* outputs in time, a multiple of GC_CNN_BLOCK */
} gc_cnn_conv_t;

#define GC_CNN_BLOCK 4 /* columns computed together: a weight is unpacked once for four products */

typedef struct gc_cnn_net {
    const char *name;
    float rate_hz;   /* the sample rate, and */
    float table_dps; /* the table's speed, of the training data */
    float clip_dps;  /* inputs are clipped to +- this, the training range of measured - true rate */
    float leak;      /* LeakyReLU's slope below zero */
    uint32_t window; /* samples of each run */
    gc_cnn_conv_t head;
    gc_cnn_conv_t combined;
    uint32_t hidden;
    uint32_t outputs; /* 2: scale, bias_dps */
    uint32_t scratch_floats;
    gc_cnn_layer_t up, down;      /* the constant row of the true rate is in their bias */
    gc_cnn_layer_t combined_conv; /* its inputs: the channels of up, then those of down */
    gc_cnn_layer_t fc1, fc2;
    const struct gc_convnet *convnet; /* network `gyrocal`, which answers instead of this one; NULL = none */
} gc_cnn_net_t;

/* up, down: measured - true rate (dps), net->window consecutive samples of each run. w_up_dps, w_down_dps: the true
 * rates about the sensed axis: +table_dps and -table_dps within 3 %. scratch: net->scratch_floats floats.
 * out: net->outputs floats, untouched on error.
 * Returns 0, GC_E_NET_RATE (another true rate), GC_E_NET_INPUT (a NaN among the samples) or GC_E_NET_WINDOW (a table
 * without the paper's network). */
int gc_cnn_run(const gc_cnn_net_t *net, const float *up, const float *down, float w_up_dps, float w_down_dps,
               float *scratch, float *out);

/* Returns output i of a fully connected layer with n inputs, before its activation. */
float gc_cnn_neuron(const gc_cnn_layer_t *layer, uint32_t i, const float *in, uint32_t n);
/* Returns whether a rate is within 3 % of the rate of the training data. */
bool gc_cnn_same_rate(float w_dps, float trained_dps);

#ifdef __cplusplus
}
#endif

#endif
