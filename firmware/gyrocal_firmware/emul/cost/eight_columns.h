/* The largest calibration that a device holds: eight effect columns and a drifting bias. */
#ifndef EIGHT_COLUMNS_H
#define EIGHT_COLUMNS_H

#include "gc_calibration.h"

GC_EFFECT(table_ripple);

static const gc_effect_column_t eight_columns[GC_MAX_EFFECT_COLUMNS] = {
    {gc_effect_table_ripple, {1, 0}}, {gc_effect_table_ripple, {1, 1}}, {gc_effect_table_ripple, {2, 0}},
    {gc_effect_table_ripple, {2, 1}}, {gc_effect_table_ripple, {3, 0}}, {gc_effect_table_ripple, {3, 1}},
    {gc_effect_table_ripple, {4, 0}}, {gc_effect_table_ripple, {4, 1}},
};

static const gc_calibration_t eight_column_calibration = {
    .name = "eight columns",
    .axis = 'z',
    .rate_hz = 145.0f,
    .table_dps = 78.0f,
    .n_run_columns = 4,
    .n_shared_columns = 4,
    .columns = eight_columns,
    .white_sd_dps = 0.0448f,
    .ou_sd_dps = 0.002f,
    .ou_tau_s = 30.0f,
};

#endif
