#include "gc_correct.h"

#include "gc_error.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#define CONVERGED_DPS 1e-5 /* changes below this are the rounding of the columns, which are float */
#define MOST_ITERATIONS 100u

/* Returns the reading that the model expects on an axis at the given true rates, in dps. */
static double expected_dps(const gc_axis_model_t *axis, double bias_dps, const gc_effect_input_t *in, const double rate_dps[3]) {
    gc_effect_input_t at = *in;
    at.rate_dps = (float)rate_dps[axis->about];
    double sum = bias_dps;
    for (unsigned i = 0; i < 3u; i++) {
        sum += axis->gain[i] * rate_dps[i];
    }
    for (unsigned i = 0; i < axis->n_columns; i++) {
        const double x = (double)axis->columns[i].column(&at, axis->columns[i].arg);
        sum += x == x ? axis->coefficients[i] * x : 0.0;
    }
    return sum;
}

int gc_correct(const gc_model_t *model, const double bias_dps[3], const double reading_dps[3], const gc_effect_input_t *in,
               double rate_dps[3]) {
    gc_effect_input_t within = *in;
    within.temp_c = gc_span_clamp(&model->fitted_temp_c, in->temp_c);
    double w[3] = {reading_dps[0], reading_dps[1], reading_dps[2]};
    bool converged = false;
    for (unsigned n = 0; n < MOST_ITERATIONS && !converged; n++) {
        double next[3];
        converged = true;
        for (unsigned i = 0; i < 3u; i++) {
            const gc_axis_model_t *axis = &model->axis[i];
            const double bias = bias_dps != NULL ? bias_dps[i] : axis->bias_dps;
            next[i] = w[i] + (reading_dps[i] - expected_dps(axis, bias, &within, w));
            converged = converged && fabs(next[i] - w[i]) < CONVERGED_DPS;
        }
        memcpy(w, next, sizeof w);
    }
    memcpy(rate_dps, w, sizeof w);
    return converged ? GC_OK : GC_E_CORRECTION;
}

unsigned gc_correct_beyond(const gc_model_t *model, const gc_effect_input_t *in, const double rate_dps[3]) {
    unsigned beyond = gc_span_holds(&model->fitted_temp_c, in->temp_c) ? 0u : GC_BEYOND_TEMPERATURE;
    for (unsigned i = 0; i < 3u; i++) {
        beyond |= gc_span_holds(&model->fitted_rate_dps[i], (float)rate_dps[i]) ? 0u : GC_BEYOND_RATE;
        beyond |= gc_span_holds(&model->fitted_acc_g[i], in->acc_g[i]) ? 0u : GC_BEYOND_ACCELERATION;
    }
    return beyond;
}
