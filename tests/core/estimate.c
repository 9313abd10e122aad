/* Baseline and estimator on numbers from stdin; results with 17 digits on stdout.
 *
 *     baseline LSB W_A W_B RATE, then twice: N and N lines "T_US COUNT"
 *         one line a checkpoint that both have: scale scale_se bias bias_se misfit n_a n_b
 *     estimator N_RUN N_ALTERNATIVES N_SHARED WHITE OU_SD OU_TAU, the prior's mean and root information (n and n x n numbers),
 *     then twice: N and N lines "BLOCK COUNT Y W X..."
 *         scale scale_se bias bias_se misfit, or the error's name; a calibration that is refused ends the program
 */
#include "gc_baseline.h"
#include "gc_error.h"
#include "gc_estimator.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static double number(void) {
    double x;
    if (scanf("%lf", &x) != 1) {
        fprintf(stderr, "estimate: a number is missing\n");
        exit(2);
    }
    return x;
}

static void print(const gc_answer_t *a) {
    printf("%.17g %.17g %.17g %.17g %.17g", a->scale, a->scale_se, a->bias_dps, a->bias_se_dps, a->misfit);
}

static void baseline(void) {
    const double lsb = number(), w_a = number(), w_b = number(), rate = number();
    gc_baseline_t run[2];
    for (int r = 0; r < 2; r++) {
        gc_baseline_begin(&run[r], rate);
        for (long n = (long)number(); n > 0; n--) {
            const uint64_t t = (uint64_t)number();
            gc_baseline_advance(&run[r], t);
            gc_baseline_add(&run[r], t, (int16_t)number());
        }
        gc_baseline_end(&run[r]);
    }
    for (unsigned k = 0; k < run[0].checkpoints && k < run[1].checkpoints; k++) {
        gc_answer_t answer;
        const int error = gc_baseline_solve(&run[0].at[k], &run[1].at[k], w_a, w_b, lsb, &answer);
        if (error != GC_OK) {
            printf("%s\n", gc_error_name(error));
        } else {
            print(&answer);
            printf(" %u %u\n", run[0].at[k].n, run[1].at[k].n);
        }
    }
}

static void estimator(void) {
    double mean[16] = {0}, root[256] = {0};
    gc_calibration_t c = {.name = "test", .axis = 'z'};
    c.n_run_columns = (unsigned)number();
    c.n_alternatives = (unsigned)number();
    c.n_shared_columns = (unsigned)number();
    c.white_sd_dps = (float)number();
    c.ou_sd_dps = (float)number();
    c.ou_tau_s = (float)number();
    const unsigned n = c.n_run_columns + c.n_shared_columns + 2u;
    for (unsigned i = 0; i < n; i++) {
        mean[i] = number();
    }
    for (unsigned i = 0; i < n * n; i++) {
        root[i] = number();
    }
    c.prior_mean = mean;
    c.prior_sqrt_information = root;
    int error = gc_estimator_check(&c);
    if (error != GC_OK) {
        printf("%s\n", gc_error_name(error));
        exit(0);
    }
    gc_marginal_t marginal[2];
    for (int r = 0; r < 2; r++) {
        gc_estimator_t e;
        gc_estimator_begin_run(&e, &c, 145.0);
        for (long k = (long)number(); k > 0; k--) {
            double x[GC_MAX_EFFECT_COLUMNS];
            const uint64_t block = (uint64_t)number();
            const uint32_t count = (uint32_t)number();
            const double y = number(), w = number();
            for (unsigned j = 0; j + 2u < n; j++) {
                x[j] = number();
            }
            gc_estimator_add_block(&e, block, count, y, w, x);
        }
        gc_estimator_marginal(&e, &marginal[r]);
    }
    gc_answer_t answer;
    error = gc_estimator_solve(&c, &marginal[0], &marginal[1], &answer);
    if (error != GC_OK) {
        printf("%s\n", gc_error_name(error));
    } else {
        print(&answer);
        printf("\n");
    }
}

int main(void) {
    char what[16];
    while (scanf("%15s", what) == 1) {
        if (strcmp(what, "baseline") == 0) {
            baseline();
        } else {
            estimator();
        }
    }
    return 0;
}
