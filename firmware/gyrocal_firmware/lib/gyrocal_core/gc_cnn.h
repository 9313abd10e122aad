/* The paper's network (Fig. 2) on two windows of rate, fused: nothing but the few columns in use is kept.
 *
 * A network is a table in a generated header (include/weights.h, written by `gyrocal export`), reached by pointer:
 *
 *     #include "weights.h"                      // static const gc_cnn_net_t gc_net;  GC_NET_SCRATCH_FLOATS
 *     float scratch[GC_NET_SCRATCH_FLOATS], out[2];
 *     int error = gc_cnn_run(&gc_net, up, down, 78.0f, -78.0f, scratch, out);
 *
 * The numbers are those of the quantised ONNX graph beside it (int8 weights, float32 activations) to float rounding,
 * and the same bits on every CPU: the order of sums is fixed.
 */
#ifndef GC_CNN_H
#define GC_CNN_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* weight = step[out] * code, row-major [out][in][kernel]; where a pool follows, step is divided by the pool's length. */
typedef struct gc_cnn_layer {
    const int8_t *code;
    const float *step;
    const float *bias;
} gc_cnn_layer_t;

/* A convolution over time, then the mean over `pool` steps, then LeakyReLU. */
typedef struct gc_cnn_conv {
    uint32_t channels;
    uint32_t kernel;
    uint32_t pool;
    uint32_t columns; /* outputs in time; a multiple of GC_CNN_BLOCK */
} gc_cnn_conv_t;

#define GC_CNN_BLOCK 4u /* columns computed together, so that a weight is unpacked once for four products */

typedef struct gc_cnn_net {
    const char *name;
    float rate_hz;    /* sample rate and */
    float table_dps;  /* speed of the table it was trained at */
    float clip_dps;   /* its input is clipped to +- this, the training range of (measured - true) */
    float leak;       /* LeakyReLU's slope below zero */
    uint32_t window;  /* samples of each run */
    gc_cnn_conv_t head;
    gc_cnn_conv_t combined;
    uint32_t hidden;
    uint32_t outputs; /* 2: scale, bias_dps */
    uint32_t scratch_floats;
    gc_cnn_layer_t up, down;     /* the constant row of the true rate is in their bias */
    gc_cnn_layer_t combined_conv; /* input channels: those of up, then those of down */
    gc_cnn_layer_t fc1, fc2;
} gc_cnn_net_t;

/* up, down: measured - true rate (dps), `window` consecutive samples of each run; w_*_dps: the true rates about the
 * sensed axis, which must be those of the training (+table_dps, -table_dps) within 3 %.
 * scratch: net->scratch_floats floats. out: net->outputs floats, untouched on error.
 * Returns 0, GC_E_NET_RATE or GC_E_NET_INPUT (a NaN). */
int gc_cnn_run(const gc_cnn_net_t *net, const float *up, const float *down, float w_up_dps, float w_down_dps,
               float *scratch, float *out);

#ifdef __cplusplus
}
#endif

#endif
