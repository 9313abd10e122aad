/* One sample corrected by a fitted model, the content of correction.h, which `gyrocal export --format c` writes.
 *
 * The model says reading = gain * w + bias + sum of effects(w). The effects depend on the true rate w itself, so the equation is
 * solved by iteration, as `gyrocal apply` does.
 */
#ifndef GC_CORRECT_H
#define GC_CORRECT_H

#include "gc_calibration.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What a model says of one axis. */
typedef struct {
    double gain[3]; /* the reading per unit of true rate about x, y and z: 1 + scale, and misalignment */
    double bias_dps;
    unsigned about; /* the axis whose true rate the columns take: 0 x, 1 y, 2 z */
    unsigned n_columns;
    const gc_effect_column_t *columns;
    const double *coefficients; /* one for each column */
} gc_axis_model_t;

typedef struct {
    const char *name;
    gc_axis_model_t axis[3];
    gc_span_t fitted_temp_c;      /* what the model was fitted on; temperatures beyond count as the nearest of these */
    gc_span_t fitted_rate_dps[3]; /* about x, y and z; a little wider than the fit's rates, because of noise */
    gc_span_t fitted_acc_g[3];    /* likewise */
} gc_model_t;

/* Bits of gc_correct_beyond. */
#define GC_BEYOND_TEMPERATURE 1u
#define GC_BEYOND_RATE 2u
#define GC_BEYOND_ACCELERATION 4u

/* Corrects the readings of one sample, in dps. bias_dps gives the bias of each axis in this power cycle (for example the mean of the
   first seconds at rest); NULL takes the model's. `in` gives temperature, time since power-on and acceleration; its other fields are
   not read. An effect whose input is NaN is left out, and a temperature beyond the model's counts as the nearest one. Returns GC_OK,
   or GC_E_CORRECTION if no rate fits the reading: then rate_dps is the last attempt. */
int gc_correct(const gc_model_t *model, const double bias_dps[3], const double reading_dps[3], const gc_effect_input_t *in,
               double rate_dps[3]);

/* Returns which quantities of a corrected sample lie beyond what the model was fitted on: the sum of their bits, 0 if none does. */
unsigned gc_correct_beyond(const gc_model_t *model, const gc_effect_input_t *in, const double rate_dps[3]);

#ifdef __cplusplus
}
#endif

#endif
