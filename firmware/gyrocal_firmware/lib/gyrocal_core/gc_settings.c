#include "gc_settings.h"

#include "gc_error.h"
#include "gc_format.h"

#include <math.h>

#define KEY "settings"
#define VERSION 5u /* version of the layout of gc_settings_t */
/* Single samples are read below this rate only: on a bus of 400 kHz a sample takes 0.4 to 0.6 ms and the look at the flag 0.1 ms,
   and a tenth of the samples at 1666 Hz was lost. */
#define SINGLE_BELOW_HZ 1500.0
#define I2C_MOST_HZ 4000.0 /* 63 bits a sample, and what is read beside them, fill a bus of 400 kHz beyond */
#define FIFO_LONGEST_S 0.25 /* the longest batch: commands are read between two batches */

static const char *const axes[] = {"x", "y", "z", NULL};
static const char *const switches[] = {"off", "on", NULL};
static const char *const by_id[] = {"auto", NULL}; /* the names of parts follow */

/* A setting is a number within a range, or one of some words; its field is a double or an int32_t accordingly. */
static const struct {
    const char *name;
    size_t field;
    double least, most;
    bool whole;
    const char *none; /* the word for NaN */
    const char *const *words;
} table[GC_SETTINGS] = {
    [GC_SETTING_RATE_HZ] = {.name = "rate_hz", .field = offsetof(gc_settings_t, rate_hz), .least = 1.0, .most = 1e6},
    [GC_SETTING_FULL_SCALE_DPS] = {.name = "full_scale_dps", .field = offsetof(gc_settings_t, full_scale_dps), .most = 1e6},
    [GC_SETTING_TABLE_DPS] =
        {.name = "table_dps", .field = offsetof(gc_settings_t, table_dps), .least = -2000.0, .most = 2000.0, .none = "none"},
    [GC_SETTING_TURN_DEG] = {.name = "turn_deg", .field = offsetof(gc_settings_t, turn_deg), .least = -1e6, .most = 1e6},
    [GC_SETTING_FIFO] = {.name = "fifo", .field = offsetof(gc_settings_t, fifo), .most = GC_BATCH_MAX, .whole = true},
    [GC_SETTING_ACCEL_G] = {.name = "accel_g", .field = offsetof(gc_settings_t, accel_g), .most = 1e3},
    [GC_SETTING_LOW_PASS] = {.name = "low_pass", .field = offsetof(gc_settings_t, low_pass), .most = 255.0, .whole = true},
    [GC_SETTING_AXIS] = {.name = "axis", .field = offsetof(gc_settings_t, axis), .most = 2.0, .words = axes},
    [GC_SETTING_AUTO] = {.name = "auto", .field = offsetof(gc_settings_t, automatic), .most = 1.0, .words = switches},
    [GC_SETTING_SENSOR] = {.name = "sensor", .field = offsetof(gc_settings_t, sensor), .most = 255.0, .words = by_id},
};

static double *number(gc_settings_t *settings, gc_setting_t row) {
    return (double *)(void *)((char *)settings + table[row].field);
}

static int32_t *choice(gc_settings_t *settings, gc_setting_t row) {
    return (int32_t *)(void *)((char *)settings + table[row].field);
}

static double value_of(const gc_settings_t *settings, gc_setting_t row) {
    const void *field = (const char *)settings + table[row].field;
    return table[row].words != NULL ? *(const int32_t *)field : *(const double *)field;
}

void gc_settings_default(gc_settings_t *settings, const gc_calibration_t *calibration) {
    *settings = (gc_settings_t){.rate_hz = 145.0, .full_scale_dps = 250.0, .table_dps = 78.0, .axis = 2};
    if (calibration == NULL) {
        return;
    }
    if (calibration->rate_hz > 0.0f) {
        settings->rate_hz = (double)calibration->rate_hz;
    }
    if (calibration->table_dps != 0.0f) {
        settings->table_dps = (double)calibration->table_dps;
    }
    settings->axis = calibration->axis == 'x' ? 0 : calibration->axis == 'y' ? 1 : 2;
}

gc_setting_t gc_settings_find(gc_text_t name) {
    unsigned row = 0;
    while (row < GC_SETTINGS && !gc_text_equals(name, table[row].name)) {
        row++;
    }
    return (gc_setting_t)row;
}

/* Word i of a row that has words, or NULL after the last one. */
static const char *word_of(gc_setting_t row, int32_t i, const gc_part_t *const *parts) {
    if (row != GC_SETTING_SENSOR || i == 0) {
        return table[row].words[i];
    }
    return parts != NULL && parts[i - 1] != NULL ? parts[i - 1]->name : NULL;
}

int gc_settings_parse(gc_settings_t *settings, gc_setting_t row, gc_text_t word, const gc_part_t *const *parts) {
    if (table[row].words != NULL) {
        for (int32_t i = 0; word_of(row, i, parts) != NULL; i++) {
            if (gc_text_equals(word, word_of(row, i, parts))) {
                *choice(settings, row) = i;
                return GC_OK;
            }
        }
        return GC_E_ARGUMENT;
    }
    if (table[row].none != NULL && gc_text_equals(word, table[row].none)) {
        *number(settings, row) = NAN;
        return GC_OK;
    }
    return gc_parse_real(word.text, word.n, number(settings, row));
}

void gc_settings_field(gc_sentence_t *s, const gc_settings_t *settings, gc_setting_t row, const gc_part_t *const *parts) {
    const double value = value_of(settings, row);
    if (table[row].words != NULL) {
        gc_sentence_text(s, table[row].name, word_of(row, (int32_t)value, parts));
    } else {
        gc_sentence_real(s, table[row].name, value);
    }
}

const gc_part_t *gc_settings_part(const gc_settings_t *settings, const gc_part_t *const *parts) {
    return parts != NULL && settings->sensor > 0 ? parts[settings->sensor - 1] : NULL;
}

static bool within_ranges(const gc_settings_t *settings) {
    for (unsigned row = 0; row < GC_SETTINGS; row++) {
        const double value = value_of(settings, (gc_setting_t)row);
        const bool known = value == value;
        const bool whole = !table[row].whole || value == floor(value);
        const bool within = value >= table[row].least && value <= table[row].most && whole;
        if (known ? !within : table[row].none == NULL) {
            return false;
        }
    }
    return true;
}

int gc_settings_check(const gc_settings_t *settings, const gc_part_t *part, const gc_port_t *port) {
    const double odr_hz = gc_part_odr_for(part, settings->rate_hz);
    if (!within_ranges(settings) || !(odr_hz > 0.0) || !gc_part_full_scale_ok(part, settings->full_scale_dps) ||
        !gc_part_accel_ok(part, settings->accel_g) || !gc_part_low_pass_ok(part, odr_hz, settings->low_pass) ||
        settings->fifo > part->batch_max || settings->fifo > FIFO_LONGEST_S * settings->rate_hz) {
        return GC_E_ARGUMENT;
    }
    if (settings->fifo == 0.0) {
        return settings->rate_hz < SINGLE_BELOW_HZ ? GC_OK : GC_E_FIFO_NEEDED;
    }
    if (settings->rate_hz > I2C_MOST_HZ && port->spi == NULL) {
        return GC_E_SPI_NEEDED;
    }
    return odr_hz == settings->rate_hz ? GC_OK : GC_E_FIFO_RATE;
}

static bool names_a_part(const gc_settings_t *settings, const gc_part_t *const *parts) {
    int32_t n = 0;
    while (parts != NULL && parts[n] != NULL) {
        n++;
    }
    return settings->sensor <= n;
}

void gc_settings_load(gc_kept_settings_t *settings, const gc_port_t *port, const gc_part_t *const *parts) {
    const gc_settings_t before = settings->now;
    if (gc_store_load(port, KEY, VERSION, &settings->record, sizeof *settings) != GC_OK || !within_ranges(&settings->now) ||
        !names_a_part(&settings->now, parts)) {
        settings->now = before;
    }
}

int gc_settings_save(gc_kept_settings_t *settings, const gc_port_t *port) {
    return port->store == NULL ? GC_OK : gc_store_save(port, KEY, VERSION, &settings->record, sizeof *settings);
}
