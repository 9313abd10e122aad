#include "gc_estimator.h"

#include "gc_error.h"
#include "gc_math.h"

#include <math.h>
#include <string.h>

#define BLOCK_S (1e-6 * GC_BLOCK_US)
#define PIVOT_MIN 1e-9 /* fraction of its column below which a pivot is only rounding */
#define MAX_COLUMNS (GC_ESTIMATOR_PARAMETERS + 2u)

/* State, a calibration's marginals at each checkpoint and an answer in progress fit 4 kB. */
typedef char gc_estimator_fits_4_kb[sizeof(gc_estimator_t) + GC_CHECKPOINTS * sizeof(gc_marginal_t) + sizeof(gc_solution_t) <= 4096u
                                        ? 1
                                        : -1];

static unsigned n_parameters(const gc_calibration_t *c) {
    return c->n_run_columns + c->n_shared_columns + 2u;
}

/* Rotates a row, zero before column `first`, into the triangle; the row is used up. What is left of it is a residual. */
static void rotate_in(double *triangle, unsigned columns, unsigned first, double *row) {
    double *pivot = triangle + GC_TRIANGLE(columns) - GC_TRIANGLE(columns - first);
    for (unsigned i = first; i + 1u < columns; pivot += columns - i, i++) {
        if (row[i] == 0.0) {
            continue;
        }
        const double r = sqrt(pivot[0] * pivot[0] + row[i] * row[i]);
        const double c = pivot[0] / r;
        const double s = row[i] / r;
        pivot[0] = r;
        for (unsigned j = i + 1u; j < columns; j++) {
            const double upper = pivot[j - i];
            pivot[j - i] = c * upper + s * row[j];
            row[j] = c * row[j] - s * upper;
        }
    }
    pivot[0] += row[columns - 1u] * row[columns - 1u];
}

/* Row i of the prior over parameters [begin, n), with its right-hand side; false if it is flat. */
static bool prior_row(const gc_calibration_t *c, unsigned i, unsigned begin, double *row) {
    const unsigned n = n_parameters(c);
    bool any = false;
    double rhs = 0.0;
    for (unsigned j = begin; j < n; j++) {
        const double r = c->prior_sqrt_information != NULL && j >= i ? c->prior_sqrt_information[i * n + j] : 0.0;
        any = any || r != 0.0;
        row[j - begin] = r;
        rhs += r != 0.0 ? r * c->prior_mean[j] : 0.0;
    }
    row[n - begin] = rhs;
    return any;
}

/* Returns GC_OK if each alternative has a prior that is not tied to other columns. */
static int check_alternatives(const gc_calibration_t *c) {
    const unsigned plain = c->n_run_columns - c->n_alternatives;
    for (unsigned i = 0; i < c->n_run_columns; i++) {
        double row[MAX_COLUMNS];
        const bool any = prior_row(c, i, 0, row);
        if (i >= plain && (!any || !(row[i] > 0.0))) {
            return GC_E_UNIDENTIFIED;
        }
        for (unsigned j = plain; j < c->n_run_columns; j++) {
            if (j != i && row[j] != 0.0) {
                return GC_E_PRIOR_COUPLED;
            }
        }
    }
    return GC_OK;
}

static bool is_finite(double x) {
    return x - x == 0.0;
}

static bool numbers_are_finite(const gc_calibration_t *c) {
    const unsigned n = n_parameters(c);
    bool finite = is_finite((double)c->white_sd_dps) && is_finite((double)c->ou_sd_dps) && is_finite((double)c->ou_tau_s) &&
                  is_finite((double)c->rate_hz) && is_finite((double)c->table_dps) && is_finite((double)c->fitted_temp_c.min) &&
                  is_finite((double)c->fitted_temp_c.max);
    for (unsigned i = 0; c->columns != NULL && i < c->n_run_columns + c->n_shared_columns; i++) {
        for (unsigned k = 0; k < GC_EFFECT_ARGS; k++) {
            finite = finite && is_finite((double)c->columns[i].arg[k]);
        }
    }
    for (unsigned i = 0; c->prior_sqrt_information != NULL && i < n * n; i++) {
        finite = finite && is_finite(c->prior_sqrt_information[i]) && (i >= n || is_finite(c->prior_mean[i]));
    }
    return finite;
}

int gc_estimator_check(const gc_calibration_t *c) {
    if (c->n_run_columns > GC_MAX_EFFECT_COLUMNS || c->n_shared_columns > GC_MAX_EFFECT_COLUMNS - c->n_run_columns) {
        return GC_E_TOO_MANY_COLUMNS;
    }
    if (c->n_alternatives > c->n_run_columns) {
        return GC_E_TOO_MANY_COLUMNS;
    }
    if (!(c->white_sd_dps > 0.0f)) {
        return GC_E_WHITE_NOISE;
    }
    if (!numbers_are_finite(c)) {
        return GC_E_CALIBRATION_NUMBER;
    }
    for (unsigned i = 0; i < c->n_run_columns; i++) {
        double row[MAX_COLUMNS];
        if (prior_row(c, i, c->n_run_columns, row)) {
            return GC_E_PRIOR_COUPLED;
        }
    }
    return check_alternatives(c);
}

bool gc_estimator_has_model(const gc_calibration_t *c) {
    bool any = c->n_run_columns + c->n_shared_columns > 0u || c->ou_sd_dps > 0.0f;
    for (unsigned i = 0; i < n_parameters(c) && !any; i++) {
        double row[MAX_COLUMNS];
        any = prior_row(c, i, 0, row);
    }
    return any;
}

bool gc_estimator_knows_sensor(const gc_calibration_t *c) {
    double row[MAX_COLUMNS];
    const unsigned n = n_parameters(c);
    return prior_row(c, n - 2u, 0, row) || prior_row(c, n - 1u, 0, row);
}

void gc_estimator_begin_run(gc_estimator_t *e, const gc_calibration_t *calibration, double rate_hz) {
    memset(e, 0, sizeof *e);
    e->calibration = calibration;
    e->rate_hz = rate_hz;
    const unsigned n = n_parameters(calibration);
    if (calibration->ou_sd_dps > 0.0f) {
        e->triangle[0] = 1.0 / (double)calibration->ou_sd_dps;
    }
    for (unsigned i = 0; i < calibration->n_run_columns - calibration->n_alternatives; i++) {
        double row[MAX_COLUMNS] = {0.0};
        if (prior_row(calibration, i, 0, row + 1)) {
            e->dof++;
            for (unsigned j = 0; j < n; j++) {
                e->norm_sq[j] += row[1u + j] * row[1u + j];
            }
            rotate_in(e->triangle, n + 2u, 1u + i, row);
        }
    }
}

/* o_next = phi o + noise: one rotation eliminates o. */
static void move_drift(gc_estimator_t *e, uint64_t blocks) {
    const gc_calibration_t *calibration = e->calibration;
    const double phi = gc_decay((double)blocks * BLOCK_S / (double)calibration->ou_tau_s);
    const double sigma = (double)calibration->ou_sd_dps * sqrt(1.0 - phi * phi);
    const double r = sqrt(e->triangle[0] * e->triangle[0] + phi * phi / (sigma * sigma));
    const double c = e->triangle[0] / r;
    const double s = phi / sigma / r;
    e->triangle[0] = c / sigma;
    for (unsigned j = 1; j < n_parameters(calibration) + 2u; j++) {
        e->triangle[j] *= s;
    }
}

void gc_estimator_add_block(gc_estimator_t *e, uint64_t block, uint32_t n, double y_dps, double w_dps, const double *x) {
    const gc_calibration_t *calibration = e->calibration;
    const unsigned effects = calibration->n_run_columns + calibration->n_shared_columns;
    const bool drift = calibration->ou_sd_dps > 0.0f;
    if (drift && e->drifting) {
        move_drift(e, block - e->last_block);
    }
    e->drifting = true;
    e->last_block = block;

    const double weight = sqrt((double)n) / (double)calibration->white_sd_dps;
    double row[MAX_COLUMNS];
    row[0] = drift ? weight : 0.0;
    for (unsigned j = 0; j < effects; j++) {
        row[1u + j] = weight * x[j];
    }
    row[1u + effects] = weight;
    row[2u + effects] = weight * w_dps;
    row[3u + effects] = weight * y_dps;
    for (unsigned j = 0; j < effects + 2u; j++) {
        e->norm_sq[j] += row[1u + j] * row[1u + j];
    }
    e->dof++;
    rotate_in(e->triangle, effects + 4u, 0, row);
}

static void close_block(gc_estimator_t *e) {
    const unsigned effects = e->calibration->n_run_columns + e->calibration->n_shared_columns;
    if (2.0 * 1e6 * (double)e->block_n >= e->rate_hz * GC_BLOCK_US) {
        const double n = (double)e->block_n;
        for (unsigned j = 0; j < effects; j++) {
            e->block_x[j] /= n;
        }
        gc_estimator_add_block(e, e->block, e->block_n, e->block_y / n, e->block_w / n, e->block_x);
    }
    e->block_n = 0;
    e->block_y = 0.0;
    e->block_w = 0.0;
    memset(e->block_x, 0, sizeof e->block_x);
}

void gc_estimator_add_sample(gc_estimator_t *e, uint64_t block, double measured_dps, double w_dps, const gc_effect_input_t *in) {
    if (block != e->block) {
        close_block(e);
        e->block = block;
    }
    e->block_n++;
    e->block_y += measured_dps - w_dps;
    e->block_w += w_dps;
    gc_effect_input_t within = *in;
    within.temp_c = gc_span_clamp(&e->calibration->fitted_temp_c, in->temp_c);
    for (unsigned j = 0; j < e->calibration->n_run_columns + e->calibration->n_shared_columns; j++) {
        const gc_effect_column_t *column = &e->calibration->columns[j];
        e->block_x[j] += (double)column->column(&within, column->arg);
    }
}

/* Returns whether a pivot is only rounding although its column is not zero. */
static bool unidentified(double pivot, double norm) {
    return norm > 0.0 && !(fabs(pivot) > PIVOT_MIN * norm);
}

void gc_estimator_marginal(gc_estimator_t *e, gc_marginal_t *marginal) {
    close_block(e);
    const gc_calibration_t *calibration = e->calibration;
    const unsigned columns = n_parameters(calibration) + 2u;
    const unsigned plain = calibration->n_run_columns - calibration->n_alternatives;
    marginal->error = GC_OK;
    marginal->n = n_parameters(calibration) - plain;
    marginal->dof = e->dof;
    const double *pivot = e->triangle + columns;
    for (unsigned i = 0; i < plain; pivot += columns - 1u - i, i++) {
        if (unidentified(pivot[0], sqrt(e->norm_sq[i]))) {
            marginal->error = GC_E_UNIDENTIFIED;
        }
        marginal->dof -= e->norm_sq[i] > 0.0 ? 1 : 0;
    }
    /* Dropping the rows of the drift and the run columns integrates them out. */
    memcpy(marginal->norm_sq, e->norm_sq + plain, marginal->n * sizeof(double));
    memcpy(marginal->triangle, pivot, GC_TRIANGLE(marginal->n + 1u) * sizeof(double));
}

/* [shared columns, bias, scale, right-hand side]: the last columns of a run's triangle. */
static unsigned common_columns(const gc_calibration_t *c) {
    return c->n_shared_columns + 3u;
}

/* Adds the rows of a triangle of `columns` columns to another of the same. */
static void add_triangle(double *to, const double *from, unsigned columns) {
    for (unsigned i = 0; i + 1u < columns; i++) {
        double row[MAX_COLUMNS] = {0.0};
        for (unsigned j = i; j < columns; j++) {
            row[j] = *from++;
        }
        rotate_in(to, columns, i, row);
    }
    to[GC_TRIANGLE(columns) - 1u] += *from;
}

/* The common triangle of a run under alternative k, whose coefficient is integrated out; returns the evidence's factor. */
static double choose(const gc_calibration_t *c, const gc_marginal_t *run, unsigned k, double *common) {
    const unsigned alternatives = c->n_alternatives;
    const unsigned columns = common_columns(c);
    const double *rows = run->triangle;
    const double *rest = rows + GC_TRIANGLE(columns + alternatives) - GC_TRIANGLE(columns);
    if (alternatives == 0u) {
        memcpy(common, rest, GC_TRIANGLE(columns) * sizeof(double));
        return 1.0;
    }
    const unsigned parameter = c->n_run_columns - alternatives + k;
    const double information = c->prior_sqrt_information[parameter * (n_parameters(c) + 1u)];
    double with[GC_TRIANGLE(MAX_COLUMNS)] = {information};
    with[columns] = information * c->prior_mean[parameter];
    memcpy(with + columns + 1u, rest, GC_TRIANGLE(columns) * sizeof(double));
    for (unsigned i = 0; i < alternatives; rows += columns + alternatives - i, i++) {
        double row[MAX_COLUMNS];
        row[0] = i <= k ? rows[k - i] : 0.0;
        memcpy(row + 1, rows + alternatives - i, columns * sizeof(double));
        rotate_in(with, columns + 1u, 0, row);
    }
    memcpy(common, with + columns + 1u, GC_TRIANGLE(columns) * sizeof(double));
    return information / fabs(with[0]);
}

static void average(gc_average_t *all, double factor, double chi2, const double value[2], const double variance[2]) {
    if (all->weight == 0.0) {
        all->least = chi2;
        memcpy(all->first, value, sizeof all->first);
    } else if (chi2 < all->least) {
        const double shrink = gc_decay(0.5 * (all->least - chi2));
        all->least = chi2;
        all->weight *= shrink;
        all->chi2 *= shrink;
        for (unsigned i = 0; i < 2u; i++) {
            all->sum[i] *= shrink;
            all->sum_sq[i] *= shrink;
        }
    }
    const double weight = chi2 > all->least ? factor * gc_decay(0.5 * (chi2 - all->least)) : factor;
    all->weight += weight;
    all->chi2 += weight * chi2;
    for (unsigned i = 0; i < 2u; i++) {
        const double off = value[i] - all->first[i];
        all->sum[i] += weight * off;
        all->sum_sq[i] += weight * (off * off + variance[i]);
    }
}

/* Adds bias and scale from a common triangle to the average. Returns GC_E_UNIDENTIFIED if it does not determine them. */
static int add_answer(const double *triangle, unsigned columns, const double *norm, double factor, gc_average_t *all) {
    const unsigned n = columns - 1u;
    const double *pivot = triangle;
    for (unsigned i = 0; i < n; pivot += columns - i, i++) {
        if (unidentified(pivot[0], norm[i]) || (i + 2u >= n && norm[i] == 0.0)) {
            return GC_E_UNIDENTIFIED;
        }
        if (norm[i] > 0.0) {
            factor *= norm[i] / fabs(pivot[0]);
        }
    }
    const double *last = pivot - 5; /* rows of bias, scale, residual */
    const double scale = last[4] / last[3];
    const double value[2] = {scale, (last[2] - last[1] * scale) / last[0]};
    const double tilt = last[1] / last[3];
    const double variance[2] = {1.0 / (last[3] * last[3]), (1.0 + tilt * tilt) / (last[0] * last[0])};
    average(all, factor, last[5], value, variance);
    return GC_OK;
}

/* Gives the prior of the shared parameters as a triangle, adds to norm_sq, and returns the number of rows that are not flat. */
static int32_t shared_prior(const gc_calibration_t *c, double *triangle, double *norm_sq) {
    const unsigned columns = common_columns(c);
    int32_t rows = 0;
    memset(triangle, 0, GC_TRIANGLE(columns) * sizeof(double));
    for (unsigned i = 0; i + 1u < columns; i++) {
        double row[MAX_COLUMNS] = {0.0};
        if (prior_row(c, c->n_run_columns + i, c->n_run_columns, row)) {
            rows++;
            for (unsigned j = 0; j + 1u < columns && norm_sq != NULL; j++) {
                norm_sq[j] += row[j] * row[j];
            }
            rotate_in(triangle, columns, i, row);
        }
    }
    return rows;
}

static unsigned hypotheses(const gc_calibration_t *c) {
    return c->n_alternatives > 0u ? c->n_alternatives : 1u;
}

int gc_estimator_begin_solve(gc_solution_t *s, const gc_calibration_t *c, const gc_marginal_t *first, const gc_marginal_t *second) {
    if (first->error != GC_OK || second->error != GC_OK) {
        return first->error != GC_OK ? first->error : second->error;
    }
    const unsigned columns = common_columns(c);
    double prior[GC_TRIANGLE(GC_ESTIMATOR_PARAMETERS + 1u)];
    memset(s, 0, sizeof *s);
    s->calibration = c;
    s->first = first;
    for (unsigned i = 0; i + 1u < columns; i++) {
        s->norm[i] = first->norm_sq[c->n_alternatives + i] + second->norm_sq[c->n_alternatives + i];
    }
    s->dof = first->dof + second->dof + shared_prior(c, prior, s->norm);
    for (unsigned i = 0; i + 1u < columns; i++) {
        s->norm[i] = sqrt(s->norm[i]);
        s->dof -= s->norm[i] > 0.0 ? 1 : 0;
    }
    for (unsigned j = 0; j < hypotheses(c); j++) {
        s->second_factor[j] = choose(c, second, j, s->second + j * GC_TRIANGLE(columns));
    }
    return GC_OK;
}

/* Columns or priors beyond the range of a double give no number. */
static bool is_answer(const gc_answer_t *a) {
    return is_finite(a->scale) && is_finite(a->bias_dps) && is_finite(a->scale_se) && a->scale_se > 0.0 &&
           is_finite(a->bias_se_dps) && a->bias_se_dps > 0.0;
}

int gc_estimator_go_on(gc_solution_t *s, bool *done, gc_answer_t *answer) {
    const unsigned columns = common_columns(s->calibration);
    double prior[GC_TRIANGLE(GC_ESTIMATOR_PARAMETERS + 1u)];
    double first[GC_TRIANGLE(GC_ESTIMATOR_PARAMETERS + 1u)];
    const double first_factor = choose(s->calibration, s->first, s->next, first);
    (void)shared_prior(s->calibration, prior, NULL);
    add_triangle(first, prior, columns);
    for (unsigned j = 0; j < hypotheses(s->calibration); j++) {
        double both[GC_TRIANGLE(GC_ESTIMATOR_PARAMETERS + 1u)];
        memcpy(both, first, GC_TRIANGLE(columns) * sizeof(double));
        add_triangle(both, s->second + j * GC_TRIANGLE(columns), columns);
        const int error = add_answer(both, columns, s->norm, first_factor * s->second_factor[j], &s->all);
        if (error != GC_OK) {
            return error;
        }
    }
    *done = ++s->next == hypotheses(s->calibration);
    if (*done) {
        const gc_average_t *all = &s->all;
        const double scale_off = all->sum[0] / all->weight;
        const double bias_off = all->sum[1] / all->weight;
        answer->scale = all->first[0] + scale_off;
        answer->scale_se = sqrt(all->sum_sq[0] / all->weight - scale_off * scale_off);
        answer->bias_dps = all->first[1] + bias_off;
        answer->bias_se_dps = sqrt(all->sum_sq[1] / all->weight - bias_off * bias_off);
        answer->misfit = s->dof > 0 ? sqrt(all->chi2 / all->weight / (double)s->dof) : NAN;
        return is_answer(answer) ? GC_OK : GC_E_UNIDENTIFIED;
    }
    return GC_OK;
}

int gc_estimator_solve(const gc_calibration_t *calibration, const gc_marginal_t *a, const gc_marginal_t *b, gc_answer_t *answer) {
    gc_solution_t solution;
    bool done = false;
    int error = gc_estimator_begin_solve(&solution, calibration, a, b);
    while (error == GC_OK && !done) {
        error = gc_estimator_go_on(&solution, &done, answer);
    }
    return error;
}
