/* One sample into the estimator with eight effect columns; its largest is the one that ends a block of 0.25 s. */
#include "cost.h"
#include "eight_columns.h"

#include "gc_estimator.h"

const unsigned cost_times = 1000;

static gc_estimator_t estimator;

void cost_prepare(void) {
    gc_estimator_begin_run(&estimator, &eight_column_calibration, 145.0);
}

void cost_act(void) {
    static unsigned i;
    const float t_s = (float)i / 145.0f;
    const gc_effect_input_t in = {.t_s = t_s, .rate_dps = 78.0f, .theta_turn = 78.0f * t_s / 360.0f, .temp_c = 25.0f};
    gc_estimator_add_sample(&estimator, i / 36u, 78.3 + 0.01 * (double)(i * 7u % 23u), 78.0, &in);
    i++;
}
