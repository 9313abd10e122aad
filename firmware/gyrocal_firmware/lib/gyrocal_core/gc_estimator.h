/* Scale and bias by least squares on [effect columns, bias, scale], with priors and a drifting bias.
 *
 * Each block of 0.25 s gives one observation: mean(y) - w = bias + scale w + sum c_j mean(x_j) + o + e, with white noise e
 * and an Ornstein-Uhlenbeck process o that is constant within a block. The method is a square-root information filter by
 * Givens rotations (Bierman, Factorization Methods for Discrete Sequential Estimation, 1977) in float64. The drift is an
 * additional state, which is eliminated block by block. A run's own columns are eliminated at its end, and two runs are
 * combined on [shared columns, bias, scale]. If runs have alternative columns, the answers of all pairs are averaged,
 * weighted by their evidence.
 */
#ifndef GC_ESTIMATOR_H
#define GC_ESTIMATOR_H

#include "gc_baseline.h"
#include "gc_calibration.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GC_ESTIMATOR_PARAMETERS (GC_MAX_EFFECT_COLUMNS + 2u)
#define GC_TRIANGLE(columns) ((columns) * ((columns) + 1u) / 2u)
/* The triangles of K alternatives over [8 - K shared columns, bias, scale, right-hand side] are largest in total for K = 4. */
#define GC_MOST_CHOSEN (4u * GC_TRIANGLE(7u))

/* The information of a run about [alternatives, shared columns, bias, scale]: an upper triangle by rows. Its last column is the
   right-hand side, its last element the sum of squared residuals. */
typedef struct {
    int error; /* GC_OK, or the reason why there is no information */
    unsigned n;
    int32_t dof;
    double norm_sq[GC_ESTIMATOR_PARAMETERS]; /* squared norm of each column before rotation, with which a pivot is compared */
    double triangle[GC_TRIANGLE(GC_ESTIMATOR_PARAMETERS + 1u)]; /* n + 1 columns */
} gc_marginal_t;

typedef struct {
    const gc_calibration_t *calibration;
    double rate_hz;
    int32_t dof;
    double norm_sq[GC_ESTIMATOR_PARAMETERS];
    double triangle[GC_TRIANGLE(GC_ESTIMATOR_PARAMETERS + 2u)]; /* [drift, parameters, right-hand side] */
    bool drifting; /* there was a block before, so the next one advances the drift */
    uint64_t last_block;
    uint64_t block; /* the block in progress */
    uint32_t block_n;
    double block_y;
    double block_w;
    double block_x[GC_MAX_EFFECT_COLUMNS];
} gc_estimator_t;

/* Returns GC_OK, or an error that says what is wrong with the calibration. */
int gc_estimator_check(const gc_calibration_t *calibration);
/* Returns whether the calibration has anything that the baseline lacks: effects, priors or drift. */
bool gc_estimator_has_model(const gc_calibration_t *calibration);
/* Returns whether the calibration has a prior of scale or bias. */
bool gc_estimator_knows_sensor(const gc_calibration_t *calibration);

/* Begins a run. The calibration must have passed gc_estimator_check. */
void gc_estimator_begin_run(gc_estimator_t *e, const gc_calibration_t *calibration, double rate_hz);
/* Adds a sample to block floor((t - t_first) / 0.25 s). w_dps is the true rate in double; in->rate_dps is the same in float. */
void gc_estimator_add_sample(gc_estimator_t *e, uint64_t block, double measured_dps, double w_dps, const gc_effect_input_t *in);
/* Adds the means of a block over n samples: y = measured - w (dps) and x, the effect columns. Blocks come in order. */
void gc_estimator_add_block(gc_estimator_t *e, uint64_t block, uint32_t n, double y_dps, double w_dps, const double *x);
/* Ends the block in progress and gives the run's information so far. More samples may be added afterwards. */
void gc_estimator_marginal(gc_estimator_t *e, gc_marginal_t *marginal);

/* An answer is computed in short parts: if a run has K alternatives, there are K parts. */
typedef struct {
    double least; /* chi-square: weights are relative to exp(-least / 2) */
    double weight;
    double first[2]; /* answer: the sums are of deviations from it */
    double sum[2];
    double sum_sq[2];
    double chi2;
} gc_average_t;

typedef struct {
    const gc_calibration_t *calibration;
    const gc_marginal_t *first;
    unsigned next; /* number of the first run's alternatives */
    int32_t dof;
    double norm[GC_ESTIMATOR_PARAMETERS];
    double second[GC_MOST_CHOSEN]; /* the second run's triangle under each of its alternatives */
    double second_factor[GC_MAX_EFFECT_COLUMNS];
    gc_average_t all;
} gc_solution_t;

/* Begins the answer from two runs. The first must stay unchanged until the answer is complete. Returns GC_OK, or the error of a
   run. */
int gc_estimator_begin_solve(gc_solution_t *solution, const gc_calibration_t *calibration, const gc_marginal_t *first,
                             const gc_marginal_t *second);
/* Computes the next part. Returns GC_OK and sets *done when the answer is complete, or returns GC_E_UNIDENTIFIED if the runs do
   not determine scale and bias. */
int gc_estimator_go_on(gc_solution_t *solution, bool *done, gc_answer_t *answer);
/* Computes all parts at once. */
int gc_estimator_solve(const gc_calibration_t *calibration, const gc_marginal_t *a, const gc_marginal_t *b, gc_answer_t *answer);

#ifdef __cplusplus
}
#endif

#endif
