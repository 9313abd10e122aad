#include "rows.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define HEADER_BYTES 32u
#define RUN_BYTES 32u
#define ROW_BYTES 24u

static uint16_t get16(const uint8_t *p) {
    return (uint16_t)(p[0] | p[1] << 8);
}

static uint32_t get32(const uint8_t *p) {
    return get16(p) | (uint32_t)get16(p + 2) << 16;
}

static uint64_t get64(const uint8_t *p) {
    return get32(p) | (uint64_t)get32(p + 4) << 32;
}

static float get_float(const uint8_t *p) {
    const uint32_t bits = get32(p);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static uint8_t *read_all(const char *path, size_t *size) {
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        return NULL;
    }
    size_t room = 1 << 16;
    uint8_t *data = malloc(room);
    *size = 0;
    while (data != NULL) {
        *size += fread(data + *size, 1, room - *size, file);
        if (*size < room) {
            break;
        }
        room *= 2;
        uint8_t *more = realloc(data, room);
        if (more == NULL) {
            free(data);
        }
        data = more;
    }
    if (data != NULL && ferror(file)) {
        free(data);
        data = NULL;
    }
    fclose(file);
    return data;
}

static const char *parse_run(const uint8_t *p, uint32_t n_rows, rows_run_t *run) {
    run->first_row = get32(p);
    run->n_rows = get32(p + 4);
    run->face = (int)(int32_t)get32(p + 8);
    run->axis = (int)(int32_t)get32(p + 12);
    run->table_dps = get_float(p + 16);
    run->turn_deg = get_float(p + 20);
    run->power_on_s = get_float(p + 24);
    run->power_cycle = get32(p + 28);
    if (run->n_rows == 0 || run->first_row > n_rows || run->n_rows > n_rows - run->first_row) {
        return "a run lies outside the rows";
    }
    if ((run->face != 1 && run->face != -1) || run->axis < 0 || run->axis > 2) {
        return "a run's face or axis is wrong";
    }
    if (isinf(run->table_dps) || isinf(run->turn_deg) || isinf(run->power_on_s)) {
        return "a run holds an infinite number";
    }
    return NULL;
}

static const char *parse(rows_t *rows, const uint8_t *data, size_t size, const gc_part_t *part) {
    if (size < HEADER_BYTES || memcmp(data, "GCSIM01\0", 8) != 0) {
        return "not a ROWS file (magic GCSIM01)";
    }
    rows->n_runs = get32(data + 8);
    rows->n_rows = get32(data + 12);
    rows->sample_rate_hz = get_float(data + 16);
    rows->full_scale_dps = get_float(data + 20);
    if (size != HEADER_BYTES + (uint64_t)RUN_BYTES * rows->n_runs + (uint64_t)ROW_BYTES * rows->n_rows) {
        return "its size does not match its header";
    }
    if (rows->n_runs == 0) {
        return "it holds no run";
    }
    if (!(rows->sample_rate_hz >= 1.0f) || gc_part_odr_for(part, (double)rows->sample_rate_hz) == 0.0) {
        return part->batch_max > 0u ? "sample_rate_hz must be within 1 and 1388, or 1666 or 3333" : "the sensor does not measure at sample_rate_hz";
    }
    if (!gc_part_full_scale_ok(part, (double)rows->full_scale_dps)) {
        return part->ranges == 5u ? "full_scale_dps must be 125, 250, 500, 1000 or 2000" : "the sensor does not have full_scale_dps";
    }
    rows->runs = calloc(rows->n_runs, sizeof *rows->runs);
    rows->rows = calloc(rows->n_rows, sizeof *rows->rows);
    if (rows->runs == NULL || rows->rows == NULL) {
        return "out of memory";
    }
    const uint8_t *p = data + HEADER_BYTES + (size_t)RUN_BYTES * rows->n_runs;
    for (uint32_t i = 0; i < rows->n_rows; i++, p += ROW_BYTES) {
        if (p[7] & 0x80) {
            return "a row's time is negative";
        }
        rows->rows[i].t_us = get64(p);
        for (size_t k = 0; k < 7; k++) {
            rows->rows[i].world[k] = (int16_t)get16(p + 8 + 2 * k);
        }
    }
    for (uint32_t i = 0; i < rows->n_runs; i++) {
        const char *wrong = parse_run(data + HEADER_BYTES + (size_t)RUN_BYTES * i, rows->n_rows, &rows->runs[i]);
        if (wrong != NULL) {
            return wrong;
        }
        for (uint32_t k = 1; k < rows->runs[i].n_rows; k++) {
            const rows_row_t *row = &rows->rows[rows->runs[i].first_row + k];
            if (row->t_us <= row[-1].t_us) {
                return "a run's time does not increase";
            }
        }
    }
    return NULL;
}

const char *rows_load(rows_t *rows, const char *path, const gc_part_t *part) {
    size_t size;
    memset(rows, 0, sizeof *rows);
    uint8_t *data = read_all(path, &size);
    if (data == NULL) {
        return "cannot be read";
    }
    const char *wrong = parse(rows, data, size, part);
    free(data);
    if (wrong != NULL) {
        rows_free(rows);
    }
    return wrong;
}

void rows_free(rows_t *rows) {
    free(rows->runs);
    free(rows->rows);
    memset(rows, 0, sizeof *rows);
}

void rows_decimal(float value, char text[ROWS_DECIMAL_MAX]) {
    for (int digits = 6; digits <= 9; digits++) {
        snprintf(text, ROWS_DECIMAL_MAX, "%.*g", digits, (double)value);
        if (strtof(text, NULL) == value) {
            break;
        }
    }
}
