/* A calibration as plain data, the content of include/calibration.h, which `gyrocal export` writes. */
#ifndef GC_CALIBRATION_H
#define GC_CALIBRATION_H

#include "gc_span.h"

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GC_MAX_EFFECT_COLUMNS 8u
#define GC_EFFECT_ARGS 4

typedef struct {
    float t_s;        /* time since the run's first sample */
    float rate_dps;   /* true rate about the sensed axis */
    float theta_turn; /* the table's angle since the run's first sample, in turns, from its rate */
    float temp_c;
    float power_on_s; /* time since power-on */
    float acc_g[3];
} gc_effect_input_t;

/* One regressor: its value at a sample, in deg/s per unit of its coefficient. arg holds its nonlinear parameters. */
typedef float (*gc_effect_fn)(const gc_effect_input_t *in, const float arg[GC_EFFECT_ARGS]);

/* Declares the regressor of effects/<id>.c. calibration.h declares those that it uses, so that no list is needed. */
#define GC_EFFECT(id) float gc_effect_##id(const gc_effect_input_t *in, const float arg[GC_EFFECT_ARGS])

typedef struct {
    gc_effect_fn column;
    float arg[GC_EFFECT_ARGS];
} gc_effect_column_t;

/* Parameters stand in the order [run columns, shared columns, bias, scale]; run columns have coefficients of their own in
   each run, shared ones keep theirs. The prior is the Gaussian with this mean and with information R^T R, R upper
   triangular, n x n row-major; a zero row is flat. R must not tie run columns to the others. NULL: all flat.
   The last n_alternatives run columns exclude each other: exactly one of them acts in a run, with equal prior probabilities.
   Their priors must not be tied to those of other columns. */
typedef struct {
    const char *name;
    char axis;        /* axis of the calibration: 'x', 'y' or 'z' */
    float rate_hz;    /* settings that a device starts with; 0 = the firmware's own */
    float table_dps;
    unsigned n_run_columns;
    unsigned n_alternatives; /* number of run columns that exclude each other */
    unsigned n_shared_columns;
    const gc_effect_column_t *columns;
    float white_sd_dps; /* of one sample */
    float ou_sd_dps;    /* drift: an Ornstein-Uhlenbeck process; 0 = none */
    float ou_tau_s;
    const double *prior_mean;
    const double *prior_sqrt_information;
    gc_span_t fitted_temp_c; /* temperatures that the priors were fitted on; columns see those beyond as the nearest of these */
} gc_calibration_t;

#ifdef __cplusplus
}
#endif

#endif
