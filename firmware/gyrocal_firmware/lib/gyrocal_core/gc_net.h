/* The interface to a network, which is the same for all kinds.
 *
 * It takes the first samples of two runs and answers in parts, none of which takes long:
 *
 *     gc_net_open(&net, &gc_net_table);
 *     memset(&work, 0, sizeof work);
 *     do {
 *         error = net.go_on(&net, &work, runs, prior, stage, &done, &answer);
 *     } while (error == GC_OK && !done);
 *
 * To add one: write its four functions in gc_net.c and let gc_net_open choose it.
 */
#ifndef GC_NET_H
#define GC_NET_H

#include "gc_cnn.h"
#include "gc_convnet.h"

#ifdef __cplusplus
extern "C" {
#endif

#ifndef GC_MAX_CNN_WINDOW
#define GC_MAX_CNN_WINDOW 290 /* samples of one window */
#endif
#ifndef GC_MAX_CNN_SAMPLES
#define GC_MAX_CNN_SAMPLES (3 * GC_MAX_CNN_WINDOW) /* kept of each run */
#endif
#ifndef GC_MAX_CNN_SCRATCH
#define GC_MAX_CNN_SCRATCH 1024 /* floats */
#endif

enum { GC_SENSE_POSITIVE, GC_SENSE_NEGATIVE, GC_SENSES }; /* of the true rate about the sensed axis */

/* The first samples of a run, without gaps. */
typedef struct {
    const int16_t *counts;
    double lsb_dps;
    double w_dps; /* true rate about the sensed axis */
} gc_net_run_t;

typedef struct {
    double scale, scale_se; /* NaN if the network has no standard errors */
    double bias_dps, bias_se_dps;
} gc_net_answer_t;

/* An answer in progress. Set it to zeros at the start of a pair of runs. */
typedef struct {
    bool half;  /* the run of positive sense is done: */
    gc_convnet_face_t first;
    bool begun; /* the other one, or this one, is in progress: */
    gc_convnet_work_t face;
    unsigned windows; /* that are done, of this pair, and the sums of their answers: */
    double sum[2];
    float up[GC_MAX_CNN_WINDOW], down[GC_MAX_CNN_WINDOW], scratch[GC_MAX_CNN_SCRATCH];
} gc_net_work_t;

typedef struct gc_net gc_net_t;

struct gc_net {
    const char *name; /* NULL: there is none */
    double rate_hz;   /* of the training data */
    uint32_t identity; /* identity of the weights, which distinguishes its answers from those of another network */
    bool corrects;     /* its answers may correct readings */
    const gc_cnn_net_t *table;
    /* Returns GC_OK, or an error that says why the network cannot answer on this firmware. */
    int (*check)(const gc_net_t *net);
    /* Returns how many samples of each run stage 0, 1 or 2 (2, 4 or 6 s) takes; 0 if there is no answer at that stage. */
    uint32_t (*samples)(const gc_net_t *net, unsigned stage);
    /* Computes the next part of a stage's answer; stages come in order. runs: by sense, with samples(net, stage) counts each.
       prior: priors of scale and bias, or NULL. Sets *done when the answer is complete. Returns GC_E_NET_RANGE if the stage has no
       answer because a reading is unlike the training data. */
    int (*go_on)(const gc_net_t *net, gc_net_work_t *work, const gc_net_run_t runs[GC_SENSES], const gc_calibration_t *prior,
                 unsigned stage, bool *done, gc_net_answer_t *answer);
};

/* Opens the network of a table of weights; NULL gives one without a name, which never answers. */
void gc_net_open(gc_net_t *net, const gc_cnn_net_t *table);

#ifdef __cplusplus
}
#endif

#endif
