/* What the device itself never asks of the core: the ends of its mathematics, all of its texts, tables and sizes that do not fit.
 *
 *     exp|tanh|sin|cos HEX      the bits of a float
 *     decay|log HEX             the bits of a double
 *     code NUMBER               name|advice
 *     field NAME LINE           the value of a field of a sentence, or -
 *     CASE                      the name of the error that a function returns, by cases[]
 */
#include "gc_baseline.h"
#include "gc_error.h"
#include "gc_estimator.h"
#include "gc_math.h"
#include "gc_net.h"
#include "gc_settings.h"
#include "gc_store.h"
#include "gc_wire.h"
#include "weights.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int16_t counts[2][GC_MAX_CNN_SAMPLES];
static gc_net_work_t work;
static gc_convnet_work_t face_work;

static void fill(void) {
    for (unsigned i = 0; i < GC_MAX_CNN_SAMPLES; i++) {
        counts[0][i] = (int16_t)(8914 + (int)(i % 7u) - 3);
        counts[1][i] = (int16_t)(-8914 + (int)(i % 5u) - 2);
    }
}

/* The sums of n readings at one block of the run. */
static gc_baseline_sums_t readings(uint32_t n) {
    return (gc_baseline_sums_t){.n = n, .sum = n, .sum_sq_diff = n, .blocks = 1, .block_samples = n, .block_sum = 1};
}

static int solve(uint32_t n_a, uint32_t n_b, double w_a_dps, double w_b_dps) {
    const gc_baseline_sums_t a = readings(n_a), b = readings(n_b);
    gc_answer_t answer;
    return gc_baseline_solve(&a, &b, w_a_dps, w_b_dps, 0.00875, &answer);
}

static int rest(uint32_t n) {
    const gc_baseline_sums_t a = readings(n);
    gc_answer_t answer;
    return gc_baseline_rest(&a, 0.00875, &answer);
}

static int paper(float w_up_dps, float w_down_dps, float reading, uint32_t window) {
    static float up[GC_MAX_CNN_WINDOW], down[GC_MAX_CNN_WINDOW], scratch[GC_MAX_CNN_SCRATCH];
    float out[2];
    gc_cnn_net_t net = gc_net;
    net.window = window;
    up[0] = reading;
    return gc_cnn_run(&net, up, down, w_up_dps, w_down_dps, scratch, out);
}

/* Readings of any size give the answer of readings at the clip. */
static int clips(void) {
    static float at[2][GC_MAX_CNN_WINDOW], beyond[2][GC_MAX_CNN_WINDOW], scratch[GC_MAX_CNN_SCRATCH];
    float out[2], expected[2];
    for (unsigned i = 0; i < gc_net.window; i++) {
        const float sign = i % 3u == 0u ? -1.0f : 1.0f;
        at[0][i] = at[1][i] = sign * gc_net.clip_dps;
        beyond[0][i] = beyond[1][i] = i % 2u == 0u ? sign * INFINITY : sign * 1e30f;
    }
    const int error = gc_cnn_run(&gc_net, at[0], at[1], 78.0f, -78.0f, scratch, expected) |
                      gc_cnn_run(&gc_net, beyond[0], beyond[1], 78.0f, -78.0f, scratch, out);
    return error != GC_OK ? error : memcmp(out, expected, sizeof out) == 0 ? GC_OK : GC_E_NET_INPUT;
}

static int check_paper(uint32_t window, uint32_t outputs, uint32_t scratch) {
    gc_cnn_net_t table = gc_net;
    gc_net_t net;
    table.convnet = NULL;
    table.window = window;
    table.outputs = outputs;
    table.scratch_floats = scratch;
    gc_net_open(&net, &table);
    return net.check(&net);
}

static int answer(const gc_cnn_net_t *table, double w_up_dps, double w_down_dps) {
    const gc_net_run_t runs[GC_SENSES] = {
        {.counts = counts[0], .lsb_dps = 0.00875, .w_dps = w_up_dps}, {.counts = counts[1], .lsb_dps = 0.00875, .w_dps = w_down_dps}};
    gc_net_t net;
    gc_net_answer_t out;
    bool done = false;
    gc_net_open(&net, table);
    memset(&work, 0, sizeof work);
    int error = GC_OK;
    while (error == GC_OK && !done) {
        error = net.go_on(&net, &work, runs, NULL, 0, &done, &out);
    }
    return error;
}

static int alone(double w_up_dps, double w_down_dps) {
    gc_cnn_net_t table = gc_net;
    table.convnet = NULL;
    return answer(&table, w_up_dps, w_down_dps);
}

static int no_network(void) {
    gc_net_t net;
    gc_net_open(&net, NULL);
    return net.name == NULL ? GC_OK : GC_E_NET_MEMORY;
}

/* A face at once is a face in parts. */
static int face_at_once(double lsb_dps) {
    gc_convnet_face_t whole, parts = {0};
    int error = gc_convnet_face(gc_net.convnet, counts[0], 1, lsb_dps, 78.0, &face_work, &whole);
    if (error == GC_OK) {
        error = gc_convnet_begin(gc_net.convnet, counts[0], 1, lsb_dps, 78.0, &face_work);
        while (!gc_convnet_go_on(gc_net.convnet, &face_work, &parts)) {
        }
        error = memcmp(&whole, &parts, sizeof whole) == 0 ? error : GC_E_NET_RANGE;
    }
    return error;
}

/* A network of which one size is larger than the arrays. */
static int too_large(unsigned which) {
    gc_convnet_t net = *gc_net.convnet;
    uint32_t *const size[] = {&net.hidden, &net.first.channels, &net.second.channels, &net.first.kernel, &net.second.kernel};
    *size[which] = 1000;
    return gc_convnet_begin(&net, counts[0], 2, 0.00875, 78.0, &face_work);
}

static gc_settings_t defaults(const gc_calibration_t *calibration) {
    gc_settings_t settings;
    gc_settings_default(&settings, calibration);
    return settings;
}

static int settings(void) {
    const gc_settings_t none = defaults(NULL);
    gc_calibration_t given = {.name = "given", .axis = 'x', .rate_hz = 208.0f, .table_dps = -30.0f, .white_sd_dps = 0.05f};
    const gc_settings_t x = defaults(&given);
    given.axis = 'y';
    given.rate_hz = given.table_dps = 0.0f;
    const gc_settings_t y = defaults(&given);
    const bool right = none.axis == 2 && none.rate_hz == 145.0 && x.axis == 0 && x.rate_hz == 208.0 && x.table_dps == -30.0 &&
                       y.axis == 1 && y.rate_hz == 145.0 && y.table_dps == 78.0;
    return right ? GC_OK : GC_E_ARGUMENT;
}

/* A calibration with one shared column of which one number is x. */
static int calibration(unsigned which, double x) {
    gc_effect_column_t column = {.column = NULL};
    double mean[3] = {0.0, 0.0, 0.0};
    double root[9] = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
    gc_calibration_t c = {.name = "c", .axis = 'z', .n_shared_columns = 1, .columns = &column, .white_sd_dps = 0.05f,
                          .prior_mean = mean, .prior_sqrt_information = root};
    float *const field[] = {&c.white_sd_dps, &c.ou_sd_dps, &c.ou_tau_s, &c.rate_hz, &c.table_dps, &column.arg[0],
                            &column.arg[GC_EFFECT_ARGS - 1]};
    if (which < 7u) {
        *field[which] = (float)x;
    } else if (which == 7u) {
        mean[2] = x;
    } else if (which == 8u) {
        root[4] = x;
    }
    return gc_estimator_check(&c);
}

static int too_many(unsigned run, unsigned shared, unsigned alternatives) {
    const gc_calibration_t c = {.name = "c", .axis = 'z', .n_run_columns = run, .n_shared_columns = shared,
                                .n_alternatives = alternatives, .white_sd_dps = 0.05f};
    return gc_estimator_check(&c);
}

static int no_store(void) {
    const gc_port_t port = {.store = NULL};
    gc_record_t record = {0};
    return gc_store_save(&port, "key", 1, &record, sizeof record);
}

static int case_named(const char *name, double x) {
    const unsigned which = (unsigned)strtoul(name + strcspn(name, "0123456789"), NULL, 10);
    const bool is_calibration = strncmp(name, "calibration", 11) == 0;
    const bool is_large = strncmp(name, "too_large", 9) == 0;
    const struct {
        const char *name;
        int error;
    } cases[] = {
        {"solve_short_first", solve(1, 9, 78.0, -78.0)},
        {"solve_short_second", solve(9, 1, 78.0, -78.0)},
        {"solve_one_rate", solve(9, 9, 78.0, 78.0)},
        {"solve", solve(9, 9, 78.0, -78.0)},
        {"rest_short", rest(1)},
        {"rest", rest(9)},
        {"paper", paper(78.0f, -78.0f, 0.0f, gc_net.window)},
        {"paper_nan", paper(78.0f, -78.0f, NAN, gc_net.window)},
        {"paper_rate_up", paper(85.0f, -78.0f, 0.0f, gc_net.window)},
        {"paper_rate_down", paper(78.0f, -70.0f, 0.0f, gc_net.window)},
        {"paper_no_window", paper(78.0f, -78.0f, 0.0f, 0)},
        {"paper_clips", clips()},
        {"check_paper", check_paper(290, 2, GC_MAX_CNN_SCRATCH)},
        {"check_no_window", check_paper(0, 2, 1)},
        {"check_window", check_paper(GC_MAX_CNN_WINDOW + 1u, 2, 1)},
        {"check_outputs", check_paper(290, 3, 1)},
        {"check_scratch", check_paper(290, 2, GC_MAX_CNN_SCRATCH + 1u)},
        {"answer", answer(&gc_net, 78.0, -78.0)},
        {"answer_one_sense", answer(&gc_net, 78.0, 78.0)},
        {"answer_other_senses", answer(&gc_net, -78.0, -78.0)},
        {"alone", alone(78.0, -78.0)},
        {"alone_rate", alone(90.0, -78.0)},
        {"no_network", no_network()},
        {"face_at_once", face_at_once(0.00875)},
        {"face_without_count", face_at_once(0.0)},
        {"settings", settings()},
        {"columns", too_many(0, 0, 0)},
        {"too_many_run", too_many(GC_MAX_EFFECT_COLUMNS + 1u, 0, 0)},
        {"too_many_shared", too_many(1, GC_MAX_EFFECT_COLUMNS, 0)},
        {"too_many_alternatives", too_many(1, 0, 2)},
        {"no_store", no_store()},
    };
    if (is_calibration || is_large) {
        return is_large ? too_large(which) : calibration(which, x);
    }
    for (unsigned i = 0; i < sizeof cases / sizeof *cases; i++) {
        if (strcmp(name, cases[i].name) == 0) {
            return cases[i].error;
        }
    }
    return 1;
}

static void of_float(float (*function)(float), const char *hex) {
    const uint32_t bits = (uint32_t)strtoul(hex, NULL, 16);
    float x;
    memcpy(&x, &bits, sizeof x);
    printf("%.17g\n", (double)function(x));
}

static void of_double(double (*function)(double), const char *hex) {
    const uint64_t bits = strtoull(hex, NULL, 16);
    double x;
    memcpy(&x, &bits, sizeof x);
    printf("%.17g\n", function(x));
}

int main(void) {
    static char line[1024], word[1024], rest_of_line[1024];
    fill();
    while (fgets(line, sizeof line, stdin) != NULL) {
        rest_of_line[0] = '\0';
        if (sscanf(line, "%s %[^\n]", word, rest_of_line) < 1) {
            return 2;
        }
        if (strcmp(word, "exp") == 0 || strcmp(word, "tanh") == 0) {
            of_float(word[0] == 'e' ? gc_exp : gc_tanh, rest_of_line);
        } else if (strcmp(word, "sin") == 0 || strcmp(word, "cos") == 0) {
            of_float(word[0] == 's' ? gc_sin_turn : gc_cos_turn, rest_of_line);
        } else if (strcmp(word, "decay") == 0 || strcmp(word, "log") == 0) {
            of_double(word[0] == 'd' ? gc_decay : gc_log, rest_of_line);
        } else if (strcmp(word, "code") == 0) {
            const int code = atoi(rest_of_line);
            printf("%s|%s\n", gc_error_name(code), gc_error_advice(code));
        } else if (strcmp(word, "field") == 0) {
            char *sentence = strchr(rest_of_line, ' ');
            gc_message_t m;
            *sentence++ = '\0';
            const int error = gc_wire_parse(sentence, strlen(sentence), &m);
            const gc_text_t *found = error == GC_OK ? gc_message_field(&m, rest_of_line) : NULL;
            printf("%.*s\n", found != NULL ? (int)found->n : 1, found != NULL ? found->text : "-");
        } else {
            const int error = case_named(word, strtod(rest_of_line, NULL));
            printf("%s\n", error == 1 ? "no such case" : gc_error_name(error));
        }
    }
    return 0;
}
