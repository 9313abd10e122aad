/* Network `gyrocal`: block means of both faces -> scale and bias with their standard deviations.
 *
 * A face at true rate w says something of u = w scale + bias alone. One small network, the same for both faces, takes a face's
 * means over blocks of 0.25 s and answers with mean and precision of u; two of them and the priors of scale and bias are
 * merged as Gaussians. One set of weights for 2, 4 and 6 s.
 *
 * The numbers are those of the quantised ONNX graph that the table was made from (int8 weights, float32 activations) to float
 * rounding, and the same bits on every CPU: the order of sums is fixed.
 */
#ifndef GC_BLOCKNET_H
#define GC_BLOCKNET_H

#include "gc_cnn.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GC_BLOCKNET_STAGES 3u
#define GC_BLOCKNET_BLOCKS 24u /* 8 a stage */
#define GC_BLOCKNET_MAX_HIDDEN 64u

typedef struct gc_blocknet {
    const char *name;
    float rate_hz;       /* of the training data, as is */
    float table_dps;     /* the table's speed */
    float clip_dps;      /* |measured - true rate| is clipped to this, the training range */
    float leak;          /* LeakyReLU's slope below zero */
    float log_precision; /* the largest */
    float gain[2];       /* up, down: a face's input is gain * (measured - true) + offset */
    float offset[2];
    float units[2]; /* what a standard deviation of the prior of scale, bias moves u by */
    float mean[2];  /* the priors: scale, bias_dps */
    float sd[2];
    uint32_t hidden;
    const float *straight; /* [stages][blocks]: the linear part of the mean of u */
    gc_cnn_layer_t first;  /* its biases are [stages][hidden] */
    gc_cnn_layer_t second;
    gc_cnn_layer_t last;
} gc_blocknet_t;

typedef struct {
    float scale;
    float bias_dps;
    float scale_sd;
    float bias_sd_dps;
    bool clipped; /* a block was beyond the training range */
} gc_blocknet_answer_t;

/* What a face says of u. */
typedef struct {
    float mean;
    float precision;
    bool clipped;
} gc_blocknet_face_t;

/* Samples of each run that stage 0, 1 or 2 takes: those of the first 2, 4 or 6 s. */
uint32_t gc_blocknet_samples(const gc_blocknet_t *net, unsigned stage);

/* Means of measured - w over blocks of 0.25 s of consecutive samples from the run's first one on; returns how many blocks,
 * at most GC_BLOCKNET_BLOCKS. */
uint32_t gc_blocknet_means(const gc_blocknet_t *net, const int16_t *counts, uint32_t n, double lsb_dps, double w_dps, float *means);

/* means: the first 8 (stage + 1) block means of a face, 0 up or 1 down. w_dps: its true rate about the sensed axis:
 * +table_dps or -table_dps within 3 %.
 * Returns 0, GC_E_NET_RATE, GC_E_NET_WINDOW (a stage or size that there is not) or GC_E_NET_INPUT (a NaN). */
int gc_blocknet_face(const gc_blocknet_t *net, const float *means, unsigned stage, unsigned face, float w_dps,
                     gc_blocknet_face_t *out);
void gc_blocknet_merge(const gc_blocknet_t *net, const gc_blocknet_face_t *up, const gc_blocknet_face_t *down,
                       gc_blocknet_answer_t *answer);
/* Both faces at once. */
int gc_blocknet_run(const gc_blocknet_t *net, const float *up, const float *down, unsigned stage, float w_up_dps,
                    float w_down_dps, gc_blocknet_answer_t *answer);

#ifdef __cplusplus
}
#endif

#endif
