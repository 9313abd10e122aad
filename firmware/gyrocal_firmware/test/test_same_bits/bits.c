/* Everything in the core that computes, on inputs made of integers; prints results bit by bit. */
#ifdef ARDUINO
#define main gyrocal_main /* board.cpp calls it */
#endif

#include "gc_baseline.h"
#include "gc_error.h"
#include "gc_estimator.h"
#include "gc_format.h"
#include "gc_math.h"
#include "gc_wire.h"
#include "weights.h"

#include <stdio.h>
#include <string.h>

static uint32_t state = 1;

static uint32_t random_bits(void) {
    state = state * 1664525u + 1013904223u;
    return state >> 8; /* 24 bits: exact in a float */
}

/* Within +-size, exact steps. */
static float random_real(float size) {
    return size * ((float)random_bits() / 8388608.0f - 1.0f);
}

static void show_float(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    if (x != x) {
        printf(" nan"); /* its sign and payload differ from CPU to CPU */
    } else {
        printf(" %08lx", (unsigned long)bits);
    }
}

static void show_double(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    if (x != x) {
        printf(" nan");
    } else {
        printf(" %08lx%08lx", (unsigned long)(bits >> 32), (unsigned long)(bits & 0xFFFFFFFFu));
    }
}

static void show_answer(const char *what, int error, const gc_answer_t *answer) {
    printf("%s %d", what, error);
    if (error == GC_OK) {
        show_double(answer->scale);
        show_double(answer->scale_se);
        show_double(answer->bias_dps);
        show_double(answer->bias_se_dps);
        show_double(answer->misfit);
    }
    printf("\n");
}

static void math(void) {
    for (unsigned i = 0; i < 600; i++) {
        const float x = random_real(i % 3u == 0 ? 100.0f : i % 3u == 1 ? 3.0f : 1e-3f);
        printf("math");
        show_float(gc_exp(x));
        show_float(gc_tanh(x));
        show_float(gc_sin_turn(x));
        show_float(gc_cos_turn(x));
        printf("\n");
    }
}

static void inference(void) {
    static float up[1024], down[1024], scratch[GC_NET_SCRATCH_FLOATS];
    static const float size[] = {0.2f, 0.0f, 3.0f, 1e30f, 1e-44f};
    for (unsigned i = 0; i < 20; i++) {
        float out[2] = {0, 0};
        for (unsigned k = 0; k < gc_net.window; k++) {
            up[k] = 0.25f + random_real(size[i % 5u]);
            down[k] = -0.375f + random_real(size[i % 5u]);
        }
        const int error = gc_cnn_run(&gc_net, up, down, gc_net.table_dps, -gc_net.table_dps, scratch, out);
        printf("inference %d", error);
        show_float(out[0]);
        show_float(out[1]);
        printf("\n");
    }
}

static int16_t random_count(double w_dps) {
    return (int16_t)(w_dps / 0.00875 + (double)random_real(20.0f));
}

/* From end to end of the scale: sums of squares go beyond 32 bits at once. */
static int16_t random_extreme(void) {
    return random_bits() & 1u ? INT16_MAX : INT16_MIN;
}

static void baseline(void) {
    static gc_baseline_t run[2];
    for (unsigned i = 0; i < 5; i++) {
        for (unsigned side = 0; side < 2; side++) {
            uint64_t t_us = 3000000u;
            gc_baseline_begin(&run[side], 145.0);
            for (unsigned k = 0; k < 900; k++) {
                gc_baseline_advance(&run[side], t_us);
                gc_baseline_add(&run[side], t_us, i == 4u ? random_extreme() : random_count(side == 0 ? 78.3 : -77.9));
                t_us += 6500u + random_bits() % 800u;
            }
            gc_baseline_end(&run[side]);
        }
        for (unsigned k = 0; k < GC_CHECKPOINTS; k++) {
            gc_answer_t answer;
            const int error = gc_baseline_solve(&run[0].at[k], &run[1].at[k], 78.0, -78.0, 0.00875, &answer);
            show_answer("baseline", error, &answer);
        }
    }
}

GC_EFFECT(spin_up);
GC_EFFECT(table_ripple);

static void estimator(void) {
    static const gc_effect_column_t columns[] = {
        {gc_effect_spin_up, {1.5f}}, {gc_effect_table_ripple, {1, 0}}, {gc_effect_table_ripple, {1, 1}}, {gc_effect_table_ripple, {2, 0}}};
    static const double mean[] = {0.0, 0.0, 0.001, 0.0, -0.05, 0.004};
    static const double information[36] = {
        [0] = 300.0, [7] = 500.0, [14] = 900.0, [15] = 30.0, [21] = 800.0, [28] = 20.0, [35] = 1000.0};
    static const gc_calibration_t calibration = {
        .name = "bits", .axis = 'z', .n_run_columns = 2, .n_shared_columns = 2, .columns = columns, .white_sd_dps = 0.0448f,
        .ou_sd_dps = 0.002f, .ou_tau_s = 30.0f, .prior_mean = mean, .prior_sqrt_information = information};
    static gc_estimator_t e;
    static gc_marginal_t marginal[2];
    for (unsigned i = 0; i < 3; i++) {
        for (unsigned side = 0; side < 2; side++) {
            const double w = side == 0 ? 78.0 : -78.0;
            gc_estimator_begin_run(&e, &calibration, 145.0);
            for (unsigned k = 0; k < 870; k++) {
                const float t_s = (float)k / 145.0f;
                const gc_effect_input_t in = {.t_s = t_s, .rate_dps = (float)w, .theta_turn = (float)(w * (double)t_s / 360.0)};
                gc_estimator_add_sample(&e, k / 36u, 1.004 * w - 0.05 + (double)random_real(0.1f), w, &in);
            }
            gc_estimator_marginal(&e, &marginal[side]);
        }
        gc_answer_t answer;
        const int error = gc_estimator_solve(&calibration, &marginal[0], &marginal[1], &answer);
        show_answer("estimator", error, &answer);
    }
}

static void wire(void) {
    for (unsigned i = 0; i < 200; i++) {
        gc_sentence_t s;
        gc_message_t m;
        uint64_t bits = (uint64_t)random_bits() << 42 ^ (uint64_t)random_bits() << 20 ^ random_bits();
        double value, back = 0.0;
        memcpy(&value, &bits, sizeof value);
        gc_sentence_begin(&s, "CAL", random_bits(), bits, i % 4u);
        gc_sentence_int(&s, NULL, (int64_t)bits);
        gc_sentence_real(&s, "real", value);
        gc_sentence_real(&s, "small", (double)random_real(0.01f));
        gc_sentence_text(&s, "text", "a,b*c");
        const int n = gc_sentence_end(&s);
        const int error = gc_wire_parse(s.text, (size_t)n, &m);
        const gc_text_t *real = gc_message_field(&m, "real");
        const int parsed = gc_parse_real(real->text, real->n, &back);
        printf("wire %.*s", n, s.text);
        printf("wire %d %d %lu", error, parsed, (unsigned long)m.seq);
        show_double(back);
        s.text[random_bits() % (unsigned)n] ^= (char)(1u << random_bits() % 7u);
        printf(" %d\n", gc_wire_parse(s.text, (size_t)n, &m));
    }
}

int main(int argc, char **argv) {
    (void)argc;
    (void)argv;
    math();
    inference();
    baseline();
    estimator();
    wire();
    return 0;
}
