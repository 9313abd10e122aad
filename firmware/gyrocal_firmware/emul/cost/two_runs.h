/* A calibration from 6 s of two runs: what stands before the answer is not counted. */
#ifndef TWO_RUNS_H
#define TWO_RUNS_H

#include "gc_estimator.h"

static gc_estimator_t estimator;
static gc_marginal_t first, second;

static void record(const gc_calibration_t *calibration, double w_dps) {
    gc_estimator_begin_run(&estimator, calibration, 145.0);
    for (unsigned i = 0; i < 870u; i++) {
        const float t_s = (float)i / 145.0f;
        const float rate_dps = (float)w_dps;
        const gc_effect_input_t in = {.t_s = t_s, .rate_dps = rate_dps, .theta_turn = rate_dps * t_s / 360.0f};
        gc_estimator_add_sample(&estimator, i / 36u, 1.004 * w_dps + 0.01 * (double)(i * 7u % 23u), w_dps, &in);
    }
}

static void two_runs(const gc_calibration_t *calibration) {
    record(calibration, 78.0);
    gc_estimator_marginal(&estimator, &first);
    record(calibration, -78.0);
}

#endif
