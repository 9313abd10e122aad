/* Any calibration and any blocks: the calibration is refused, or each answer is finite with errors above zero, or has an error's
   name. The effects' columns are computed from any sample, too. */
#include "gc_error.h"
#include "gc_estimator.h"

#include "fuzz.h"

GC_EFFECT(bias_temperature);
GC_EFFECT(g_sensitivity);
GC_EFFECT(g2_sensitivity);
GC_EFFECT(order_tone);
GC_EFFECT(scale_nonlinearity);
GC_EFFECT(spin_up);
GC_EFFECT(table_ripple);
GC_EFFECT(warmup);

#define MOST 16u

static const gc_effect_fn effects[] = {gc_effect_bias_temperature, gc_effect_g_sensitivity,     gc_effect_g2_sensitivity,
                                       gc_effect_order_tone,       gc_effect_scale_nonlinearity, gc_effect_spin_up,
                                       gc_effect_table_ripple,     gc_effect_warmup};

static int finite(double x) {
    return x - x == 0.0;
}

static float real32(fuzz_input_t *in, double size) {
    const double value = fuzz_real(in, size);
    const double most = 3e38;
    return value > most ? (float)most : value < -most ? (float)-most : (float)value;
}

static void add_run(gc_estimator_t *e, fuzz_input_t *in) {
    const unsigned blocks = fuzz_byte(in) % 32u;
    uint64_t block = 0;
    for (unsigned i = 0; i < blocks; i++) {
        gc_effect_input_t sample = {.t_s = real32(in, 100.0),     .rate_dps = real32(in, 300.0), .theta_turn = real32(in, 10.0),
                                    .temp_c = real32(in, 100.0),  .power_on_s = real32(in, 1e4),
                                    .acc_g = {real32(in, 2.0), real32(in, 2.0), real32(in, 2.0)}};
        const double w_dps = fuzz_real(in, 300.0);
        block += 1u + fuzz_byte(in) % 4u;
        for (unsigned k = 0; k < 1u + fuzz_byte(in) % 8u; k++) {
            gc_estimator_add_sample(e, block, fuzz_real(in, 300.0), w_dps, &sample);
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n) {
    fuzz_input_t in = {.data = data, .n = n};
    double mean[MOST] = {0}, root[MOST * MOST] = {0};
    gc_effect_column_t columns[MOST];
    gc_calibration_t c = {.name = "fuzz", .axis = 'z', .rate_hz = 145.0f, .columns = columns};
    c.n_run_columns = fuzz_byte(&in) % 11u;
    c.n_shared_columns = fuzz_byte(&in) % 11u;
    c.n_alternatives = fuzz_byte(&in) % 5u;
    c.white_sd_dps = real32(&in, 0.2);
    c.ou_sd_dps = real32(&in, 0.2);
    c.ou_tau_s = real32(&in, 200.0);
    for (unsigned i = 0; i < MOST; i++) {
        columns[i].column = effects[fuzz_byte(&in) % (sizeof effects / sizeof effects[0])];
        for (unsigned k = 0; k < GC_EFFECT_ARGS; k++) {
            columns[i].arg[k] = real32(&in, 8.0);
        }
    }
    const unsigned parameters = c.n_run_columns + c.n_shared_columns + 2u;
    if (parameters <= MOST && fuzz_byte(&in) % 2u == 0u) {
        for (unsigned i = 0; i < parameters; i++) {
            mean[i] = fuzz_real(&in, 1.0);
            root[i * parameters + i] = fuzz_real(&in, 1e4);
            if (i > 0u) {
                root[(i - 1u) * parameters + i] = fuzz_real(&in, 1.0);
            }
        }
        c.prior_mean = mean;
        c.prior_sqrt_information = root;
    }
    const int refused = gc_estimator_check(&c);
    if (refused != GC_OK) {
        fuzz_must(strcmp(gc_error_name(refused), "unknown") != 0, "an error without a name");
        return 0;
    }
    gc_marginal_t marginal[2];
    for (unsigned r = 0; r < 2u; r++) {
        gc_estimator_t e;
        gc_estimator_begin_run(&e, &c, 145.0);
        add_run(&e, &in);
        gc_estimator_marginal(&e, &marginal[r]);
    }
    gc_answer_t answer;
    const int error = gc_estimator_solve(&c, &marginal[0], &marginal[1], &answer);
    fuzz_must(error == GC_OK || strcmp(gc_error_name(error), "unknown") != 0, "an error without a name");
    if (error == GC_OK) {
        fuzz_must(finite(answer.scale) && finite(answer.bias_dps), "an answer that is no number");
        fuzz_must(answer.scale_se > 0.0 && answer.bias_se_dps > 0.0, "an answer without an error");
    }
    return 0;
}
