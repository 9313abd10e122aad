/* Scale and bias from 6 s of two runs with a ripple, six alternative transients and drift: 36 pairs. */
#include "cost.h"

#include "gc_estimator.h"

GC_EFFECT(table_ripple);
GC_EFFECT(spin_up);

static const gc_effect_column_t columns[GC_MAX_EFFECT_COLUMNS] = {
    {gc_effect_table_ripple, {1, 0}}, {gc_effect_table_ripple, {1, 1}}, {gc_effect_spin_up, {0.8f}},
    {gc_effect_spin_up, {1.1f}},      {gc_effect_spin_up, {1.5f}},      {gc_effect_spin_up, {2.1f}},
    {gc_effect_spin_up, {3.0f}},      {gc_effect_spin_up, {4.2f}},
};

#define PARAMETERS (GC_MAX_EFFECT_COLUMNS + 2u)
static double prior_mean[PARAMETERS], prior_root[PARAMETERS * PARAMETERS];

static const gc_calibration_t calibration = {
    .name = "alternatives",
    .axis = 'z',
    .n_run_columns = GC_MAX_EFFECT_COLUMNS,
    .n_alternatives = 6,
    .columns = columns,
    .white_sd_dps = 0.0448f,
    .ou_sd_dps = 0.002f,
    .ou_tau_s = 30.0f,
    .prior_mean = prior_mean,
    .prior_sqrt_information = prior_root,
};

const unsigned cost_times = 5;

static gc_estimator_t estimator;
static gc_marginal_t first, second;

static void record(double w_dps) {
    gc_estimator_begin_run(&estimator, &calibration, 145.0);
    for (unsigned i = 0; i < 870u; i++) {
        const float t_s = (float)i / 145.0f;
        const float rate_dps = (float)w_dps;
        const gc_effect_input_t in = {.t_s = t_s, .rate_dps = rate_dps, .theta_turn = rate_dps * t_s / 360.0f};
        gc_estimator_add_sample(&estimator, i / 36u, 1.004 * w_dps + 0.01 * (double)(i * 7u % 23u), w_dps, &in);
    }
}

void cost_prepare(void) {
    for (unsigned i = 0; i < PARAMETERS; i++) {
        prior_root[i * (PARAMETERS + 1u)] = i + 2u < PARAMETERS ? 600.0 : i + 1u < PARAMETERS ? 25.0 : 2000.0;
    }
    record(78.0);
    gc_estimator_marginal(&estimator, &first);
    record(-78.0);
}

void cost_act(void) {
    gc_answer_t answer;
    gc_estimator_marginal(&estimator, &second);
    gc_estimator_solve(&calibration, &first, &second, &answer);
}
