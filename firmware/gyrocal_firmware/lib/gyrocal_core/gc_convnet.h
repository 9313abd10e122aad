/* Network `gyrocal`, which estimates scale and bias with their standard deviations from the readings of each face.
 *
 * A face at true rate w determines only u = w scale + bias. Its mean is a first estimate. A convolutional network, the same for
 * both faces, takes the readings less their mean and gives a correction and its precision. The weights do not depend on the
 * distribution of scale and bias, because two faces and the priors of calibration.h are combined in closed form. One set of
 * weights serves 2, 4 and 6 s.
 *
 * The numbers are those of the quantised ONNX graph that the table was made from (int8 weights, float32 activations) to float
 * rounding, and the same bits on every CPU: the order of sums is fixed. Means and the merge are in double, sums of raw counts in
 * integers, so that a constant added to the readings is added to u.
 */
#ifndef GC_CONVNET_H
#define GC_CONVNET_H

#include "gc_baseline.h"
#include "gc_calibration.h"
#include "gc_cnn.h"

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

/* The first convolution's taps are `pool` samples apart: with its average pool it is a convolution over means of `pool` samples,
 * the columns. The second one's own pool is in `second`. */
typedef struct gc_convnet {
    const char *name;
    float rate_hz;          /* of the training data, as is */
    float table_dps;        /* the table's speed */
    float unit_dps;         /* columns are in this unit */
    float column_range_dps; /* the largest |column - mean| of the training data, */
    float sample_range_dps; /* and |sample - column| that is accepted */
    float leak;             /* LeakyReLU's slope below zero */
    float log_precision;    /* the largest */
    uint32_t pool;
    uint32_t stage_columns; /* columns of 2 s */
    gc_cnn_conv_t first;    /* `columns`: of its outputs after 6 s, as of the second */
    gc_cnn_conv_t second;
    uint32_t hidden; /* neurons in each of the two layers behind the convolutions */
    const float *straight; /* [stages][columns]: the linear part of the correction */
    gc_cnn_layer_t first_layer;
    gc_cnn_layer_t second_layer;
    gc_cnn_layer_t third_layer; /* codes [hidden][times][channels], biases [stages][hidden] */
    gc_cnn_layer_t fourth_layer;
    gc_cnn_layer_t last_layer;
} gc_convnet_t;

/* The estimate of u = w scale + bias from one face. */
typedef struct {
    double w_dps;
    double u_dps;
    double precision; /* 1/dps^2 */
} gc_convnet_face_t;

typedef struct {
    unsigned stage;
    bool convolved;    /* the first layer is done, */
    uint32_t channels; /* so many channels of the second, */
    uint32_t hidden;   /* so many neurons of the third */
    double w_dps;
    double mean_dps; /* of measured - true rate */
    float columns[GC_CONVNET_MAX_COLUMNS];
    float sums[GC_CONVNET_MAX_SUMS];
    float features[GC_CONVNET_MAX_FEATURES];
    float third[GC_CONVNET_MAX_HIDDEN];
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
