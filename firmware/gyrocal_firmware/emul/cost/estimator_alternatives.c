/* A seventh of scale and bias from 6 s of two runs with a ripple, six alternative transients and drift: what a sample waits for. */
#include "cost.h"
#include "two_runs.h"

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

const unsigned cost_times = 7 * 5;

static gc_solution_t solution;
static bool done = true;

void cost_prepare(void) {
    for (unsigned i = 0; i < PARAMETERS; i++) {
        prior_root[i * (PARAMETERS + 1u)] = i + 2u < PARAMETERS ? 600.0 : i + 1u < PARAMETERS ? 25.0 : 2000.0;
    }
    two_runs(&calibration);
}

void cost_act(void) {
    gc_answer_t answer;
    if (done) {
        gc_estimator_marginal(&estimator, &second);
        (void)gc_estimator_begin_solve(&solution, &calibration, &first, &second);
        done = false;
    } else {
        (void)gc_estimator_go_on(&solution, &done, &answer);
    }
}
