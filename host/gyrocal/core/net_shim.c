/* The networks of a weights.h on arrays, for ctypes. */

#include "gc_convnet.h"
#include "gc_error.h"
#include "weights.h"

#include <math.h>

const gc_cnn_net_t *gyrocal_net(void);
const gc_convnet_t *gyrocal_convnet(void);
int gyrocal_convnet_infer(const int16_t *counts, uint32_t n, unsigned stage, double lsb_dps, double w_dps, float *out);
int gyrocal_convnet_face(const int16_t *counts, uint32_t n, unsigned stage, double lsb_dps, double w_dps, double *out);
void gyrocal_convnet_merge(const double *prior_mean, const double *prior_root, const double *faces, uint32_t n, double *out);
int gyrocal_net_run(const float *up, const float *down, uint32_t n, float w_up_dps, float w_down_dps, float *out);

const gc_cnn_net_t *gyrocal_net(void) { return &gc_net; }
const gc_convnet_t *gyrocal_convnet(void) { return gc_net.convnet; }

/* out: [n][2], NaN where out of range */
int gyrocal_convnet_infer(const int16_t *counts, uint32_t n, unsigned stage, double lsb_dps, double w_dps, float *out)
{
    for (uint32_t i = 0; i < n; i++, counts += gc_convnet_samples(gc_net.convnet, stage), out += 2) {
        gc_convnet_work_t work = {.out = {NAN, NAN}};
        gc_convnet_face_t face;
        int error = gc_convnet_face(gc_net.convnet, counts, stage, lsb_dps, w_dps, &work, &face);
        error = error == GC_E_NET_RANGE ? GC_OK : error;
        out[0] = work.out[0];
        out[1] = work.out[1];
        if (error) {
            return error;
        }
    }
    return GC_OK;
}

/* out: [n][2], u and its precision, NaN where out of range */
int gyrocal_convnet_face(const int16_t *counts, uint32_t n, unsigned stage, double lsb_dps, double w_dps, double *out)
{
    for (uint32_t i = 0; i < n; i++, counts += gc_convnet_samples(gc_net.convnet, stage), out += 2) {
        gc_convnet_work_t work;
        gc_convnet_face_t face = {0.0, NAN, NAN};
        int error = gc_convnet_face(gc_net.convnet, counts, stage, lsb_dps, w_dps, &work, &face);
        if (error && error != GC_E_NET_RANGE) {
            return error;
        }
        out[0] = face.u_dps;
        out[1] = face.precision;
    }
    return GC_OK;
}

/* prior of bias and scale, NULL: none; faces: [n][2][w, u, precision]; out: [n][4] */
void gyrocal_convnet_merge(const double *prior_mean, const double *prior_root, const double *faces, uint32_t n, double *out)
{
    const gc_calibration_t calibration = {.prior_mean = prior_mean, .prior_sqrt_information = prior_root};
    for (uint32_t i = 0; i < n; i++, faces += 6, out += 4) {
        const gc_convnet_face_t up = {faces[0], faces[1], faces[2]}, down = {faces[3], faces[4], faces[5]};
        gc_answer_t answer = {0};
        gc_convnet_merge(&calibration, &up, &down, &answer);
        out[0] = answer.scale;
        out[1] = answer.bias_dps;
        out[2] = answer.scale_se;
        out[3] = answer.bias_se_dps;
    }
}

int gyrocal_net_run(const float *up, const float *down, uint32_t n, float w_up_dps, float w_down_dps, float *out)
{
    float scratch[GC_NET_SCRATCH_FLOATS];
    for (uint32_t i = 0; i < n; i++) {
        int error = gc_cnn_run(&gc_net, up + i * gc_net.window, down + i * gc_net.window, w_up_dps, w_down_dps, scratch,
                               out + i * gc_net.outputs);
        if (error) {
            return error;
        }
    }
    return 0;
}
