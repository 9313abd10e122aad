/* Network `gyrocal`, which estimates scale and bias with their standard deviations from the readings of each face.
 *
 * A face at true rate w determines only u = w scale + bias. Its mean is a first estimate. A convolutional network, the same for
 * both faces, takes the readings less their mean and gives a correction and its precision. The weights do not depend on the
 * distribution of scale and bias, because two faces and the priors of calibration.h are combined in closed form. One set of
 * weights serves 2, 4 and 6 s.
 *
 * The layers are computed in float32, or with GC_NET_FIXED in integers. In float32 the numbers are those of the quantised ONNX
 * graph that the table was made from (int8 weights, float32 activations) to float rounding; in integers they differ from these by
 * some hundredths of the answer's standard error (docs/network.md). Both are the same bits on every CPU: the order of sums is
 * fixed. Means and the merge are in double, sums of raw counts in integers, so that a constant added to the readings is added to u.
 */
#ifndef GC_CONVNET_H
#define GC_CONVNET_H

#include "gc_baseline.h"
#include "gc_calibration.h"
#include "gc_cnn.h"
#include "gc_halfwords.h"

/* 1: layers in integers, 0: in float32. By default in integers where the CPU has no FPU. */
#ifndef GC_NET_FIXED
#if (defined(__riscv) && !defined(__riscv_flen)) || (defined(__arm__) && !defined(__ARM_FP)) || defined(__XTENSA_SOFT_FLOAT__)
#define GC_NET_FIXED 1
#else
#define GC_NET_FIXED 0
#endif
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define GC_CONVNET_STAGES 3u
#define GC_CONVNET_MAX_COLUMNS 32u
#define GC_CONVNET_MAX_ROWS 256u /* of the first convolution: channels x times */
#define GC_CONVNET_MAX_FEATURES 160u /* of the second: times x channels */
#define GC_CONVNET_MAX_TAPS 32u   /* of a kernel, all channels */
#define GC_CONVNET_MAX_SUMS 320u  /* of the second convolution: taps x times */
#define GC_CONVNET_MAX_HIDDEN 64u

#if GC_NET_FIXED && GC_HAS_HALFWORDS
typedef int16_t gc_convnet_code_t; /* so that pairs of codes are at hand */
#else
typedef int8_t gc_convnet_code_t;
#endif

#if GC_NET_FIXED
typedef int16_t gc_convnet_number_t;
typedef int32_t gc_convnet_hidden_t;

/* An output is (start + sum of code * input) * gain / 2^32, rounded down. The start holds the bias and half an output, so that the
 * output is rounded to the nearest. The export proves that no input within the network's range lets a sum overflow. */
typedef struct gc_convnet_layer {
    const gc_convnet_code_t *code; /* as in gc_cnn_layer_t */
    const int32_t *gain; /* the last layer has none: its sums are its outputs */
    const int32_t *start;
} gc_convnet_layer_t;
#else
typedef float gc_convnet_number_t;
typedef float gc_convnet_hidden_t;
typedef gc_cnn_layer_t gc_convnet_layer_t;
#endif

/* The first convolution's taps are `pool` samples apart: with its average pool it is a convolution over means of `pool` samples,
 * the columns. The second one's own pool is in `second`. */
typedef struct gc_convnet {
    const char *name;
    float rate_hz;          /* of the training data, as is */
    float table_dps;        /* the table's speed */
    float unit_dps;         /* columns are in this unit */
    float column_range_dps; /* the largest |column - mean| of the training data, */
    float sample_range_dps; /* and |sample - column| that is accepted */
    float log_precision;    /* the largest */
    uint32_t pool;
    uint32_t stage_columns; /* columns of 2 s */
    gc_cnn_conv_t first;    /* `columns`: of its outputs after 6 s, as of the second */
    gc_cnn_conv_t second;
    uint32_t hidden; /* neurons in each of the two layers behind the convolutions */
#if GC_NET_FIXED
    int32_t leak;               /* LeakyReLU's slope below zero times 2^15 */
    float columns_a_unit;       /* what a column of one unit becomes */
    const int16_t *straight;    /* [stages][columns]: the linear part of the correction, */
    const float *straight_step; /* the unit's part that one is at each stage, */
    const float *last_step;     /* and in each of the last layer's sums */
#else
    float leak;            /* LeakyReLU's slope below zero */
    const float *straight; /* [stages][columns]: the linear part of the correction */
#endif
    gc_convnet_layer_t first_layer;
    gc_convnet_layer_t second_layer;
    gc_convnet_layer_t third_layer; /* codes [hidden][times][channels], biases [stages][hidden] */
    gc_convnet_layer_t fourth_layer;
    gc_convnet_layer_t last_layer;
} gc_convnet_t;

/* The estimate of u = w scale + bias from one face. */
typedef struct {
    double w_dps;
    double u_dps;
    double precision; /* 1/dps^2 */
} gc_convnet_face_t;

typedef struct {
    unsigned stage;
    uint32_t parts; /* that are done */
    double w_dps;
    double mean_dps; /* of measured - true rate */
    gc_convnet_number_t columns[GC_CONVNET_MAX_COLUMNS];
    gc_convnet_number_t sums[GC_CONVNET_MAX_SUMS]; /* over the second convolution's pool */
    gc_convnet_number_t features[GC_CONVNET_MAX_FEATURES];
    gc_convnet_hidden_t third[GC_CONVNET_MAX_HIDDEN];
    float out[2]; /* the correction, in units, and the logarithm of its precision */
} gc_convnet_work_t;

/* Returns how many samples of each run stage 0, 1 or 2 takes: those of the first 2, 4 or 6 s. */
uint32_t gc_convnet_samples(const gc_convnet_t *net, unsigned stage);

/* Begins a face, which is then computed in short parts. counts: consecutive samples from the run's first one on, at least
 * gc_convnet_samples; they are not needed afterwards. w_dps: the true rate about the sensed axis, +table_dps or -table_dps
 * within 3 %.
 * Returns 0, GC_E_NET_RATE, GC_E_NET_RANGE (a reading is not like any of the training data) or GC_E_NET_MEMORY (a table larger
 * than the arrays here). */
int gc_convnet_begin(const gc_convnet_t *net, const int16_t *counts, unsigned stage, double lsb_dps, double w_dps,
                     gc_convnet_work_t *work);
/* Computes the next part. Returns true when the face is done. */
bool gc_convnet_go_on(const gc_convnet_t *net, gc_convnet_work_t *work, gc_convnet_face_t *face);
/* Computes all parts of a face at once. */
int gc_convnet_face(const gc_convnet_t *net, const int16_t *counts, unsigned stage, double lsb_dps, double w_dps,
                    gc_convnet_work_t *work, gc_convnet_face_t *face);
/* Computes scale and bias from both faces and the priors of the calibration (NULL: flat priors). Leaves the misfit as it is. */
void gc_convnet_merge(const gc_calibration_t *calibration, const gc_convnet_face_t *up, const gc_convnet_face_t *down,
                      gc_answer_t *answer);

#ifdef __cplusplus
}
#endif

#endif
