/* The estimator of a calibration.h on many scenarios, for ctypes. */

#include "calibration.h"
#include "gc_error.h"
#include "gc_estimator.h"

typedef struct {
    double rate_hz, table_dps, power_on_s[2], temp_c;
    uint32_t samples, times;
    const uint64_t *until_us;
} protocol_t;

char gyrocal_axis(void);
int gyrocal_run(const protocol_t *p, const double *up, const double *down, uint32_t n, double *out);

char gyrocal_axis(void) { return gc_calibration.axis; }

static void record(const protocol_t *p, unsigned face, const double *residual, gc_marginal_t *at)
{
    const double sign = face == 0u ? 1.0 : -1.0;
    gc_estimator_t e;
    uint32_t next = 0;
    gc_estimator_begin_run(&e, &gc_calibration, p->rate_hz);
    for (uint32_t i = 0; i < p->samples; i++) {
        const uint64_t t_us = (uint64_t)(1e6 * (double)i / p->rate_hz + 0.5);
        const double t_s = 1e-6 * (double)t_us, w_dps = sign * p->table_dps;
        gc_effect_input_t in = {
            .t_s = (float)t_s, .rate_dps = (float)w_dps, .theta_turn = (float)(p->table_dps * t_s / 360.0),
            .temp_c = (float)p->temp_c, .power_on_s = (float)(p->power_on_s[face] + t_s)};
        in.acc_g[gc_calibration.axis - 'x'] = (float)sign;
        while (next < p->times && t_us >= p->until_us[next]) {
            gc_estimator_marginal(&e, &at[next++]);
        }
        gc_estimator_add_sample(&e, t_us / GC_BLOCK_US, w_dps + residual[i], w_dps, &in);
    }
    while (next < p->times) {
        gc_estimator_marginal(&e, &at[next++]);
    }
}

int gyrocal_run(const protocol_t *p, const double *up, const double *down, uint32_t n, double *out)
{
    gc_marginal_t at[2][GC_CHECKPOINTS];
    int error = gc_estimator_check(&gc_calibration);
    for (uint32_t i = 0; i < n && error == GC_OK; i++) {
        record(p, 0, up + i * p->samples, at[0]);
        record(p, 1, down + i * p->samples, at[1]);
        for (uint32_t k = 0; k < p->times && error == GC_OK; k++) {
            gc_answer_t a;
            error = gc_estimator_solve(&gc_calibration, &at[0][k], &at[1][k], &a);
            double *row = out + (k * n + i) * 5u;
            row[0] = a.scale;
            row[1] = a.scale_se;
            row[2] = a.bias_dps;
            row[3] = a.bias_se_dps;
            row[4] = a.misfit;
        }
    }
    return error;
}
