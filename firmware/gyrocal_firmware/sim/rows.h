/* Raw samples to replay, in the counts of an LSM6DSO, which other parts round to theirs. A ROWS file, little-endian:
 *
 *     header, 32 bytes   char magic[8] = "GCSIM01\0"; uint32 n_runs, n_rows; float sample_rate_hz, full_scale_dps; uint32 reserved[2]
 *     n_runs x 32 bytes  uint32 first_row, n_rows; int32 face (+1 up, -1 down), axis (0 x, 1 y, 2 z); float table_dps (signed,
 *                        NaN = unknown), turn_deg (NaN = none), power_on_s (NaN = unknown); uint32 power_cycle
 *     n_rows x 24 bytes  int64 t_us (within the run, increasing); int16 temp, gx, gy, gz, ax, ay, az; uint16 flags (0)
 */
#ifndef ROWS_H
#define ROWS_H

#include "gc_sensor.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    uint32_t first_row, n_rows;
    int face, axis;
    float table_dps, turn_deg, power_on_s;
    uint32_t power_cycle;
} rows_run_t;

typedef struct {
    uint64_t t_us;
    int16_t world[7]; /* temperature, gyroscope, accelerometer: raw counts */
} rows_row_t;

typedef struct {
    float sample_rate_hz, full_scale_dps;
    uint32_t n_runs, n_rows;
    rows_run_t *runs;
    rows_row_t *rows;
} rows_t;

/* Returns NULL, or a description of the error in the file. part is the sensor that they are for. */
const char *rows_load(rows_t *rows, const char *path, const gc_part_t *part);
void rows_free(rows_t *rows);

#define ROWS_DECIMAL_MAX 32
/* Writes the shortest decimal number of this float32: 77.3, as a person set it, instead of 77.3000031. */
void rows_decimal(float value, char text[ROWS_DECIMAL_MAX]);

#endif
