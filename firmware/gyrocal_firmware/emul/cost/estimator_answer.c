/* Scale and bias from 6 s of two runs with eight effect columns. */
#include "cost.h"
#include "eight_columns.h"

#include "gc_estimator.h"

const unsigned cost_times = 10;

static gc_estimator_t estimator;
static gc_marginal_t first, second;

static void record(double w_dps) {
    gc_estimator_begin_run(&estimator, &eight_column_calibration, 145.0);
    for (unsigned i = 0; i < 870u; i++) {
        const float t_s = (float)i / 145.0f;
        const float rate_dps = (float)w_dps;
        const gc_effect_input_t in = {.t_s = t_s, .rate_dps = rate_dps, .theta_turn = rate_dps * t_s / 360.0f};
        gc_estimator_add_sample(&estimator, i / 36u, 1.004 * w_dps + 0.01 * (double)(i * 7u % 23u), w_dps, &in);
    }
}

void cost_prepare(void) {
    record(78.0);
    gc_estimator_marginal(&estimator, &first);
    record(-78.0);
}

void cost_act(void) {
    gc_answer_t answer;
    gc_estimator_marginal(&estimator, &second);
    gc_estimator_solve(&eight_column_calibration, &first, &second, &answer);
}
