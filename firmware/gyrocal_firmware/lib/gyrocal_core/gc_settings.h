/* The settings of a device. One table (gc_settings.c) holds each setting's name, field and range; set, get, $HEL, the checks and
 * the store use it. */
#ifndef GC_SETTINGS_H
#define GC_SETTINGS_H

#include "gc_calibration.h"
#include "gc_sensor.h"
#include "gc_store.h"
#include "gc_wire.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    double rate_hz;
    double full_scale_dps;
    double table_dps; /* NaN = unknown */
    double turn_deg;  /* 0 = none */
    double fifo;      /* samples taken at once out of the sensor's FIFO; 0 = each as it comes */
    double accel_g;   /* range of the accelerometer; 0 = the part's least */
    double low_pass;  /* number of the gyroscope's low-pass; 0 = the driver's choice */
    int32_t axis;     /* 0 x, 1 y, 2 z */
    int32_t automatic;
    int32_t sensor;   /* number of the part in the device's list, counted from 1; 0 = the one that its id tells */
    int32_t reserved;
} gc_settings_t;

/* The settings as they are kept over power-off. */
typedef struct {
    gc_record_t record;
    gc_settings_t now;
} gc_kept_settings_t;

/* Rows of the table. */
typedef enum {
    GC_SETTING_RATE_HZ,
    GC_SETTING_FULL_SCALE_DPS,
    GC_SETTING_TABLE_DPS,
    GC_SETTING_TURN_DEG,
    GC_SETTING_FIFO,
    GC_SETTING_ACCEL_G,
    GC_SETTING_LOW_PASS,
    GC_SETTING_AXIS,
    GC_SETTING_AUTO,
    GC_SETTING_SENSOR,
    GC_SETTINGS
} gc_setting_t;

/* Sets the firmware's defaults, or those of the calibration if it has some. calibration may be NULL. */
void gc_settings_default(gc_settings_t *settings, const gc_calibration_t *calibration);
/* Returns the row of a name, or GC_SETTINGS for an unknown one. */
gc_setting_t gc_settings_find(gc_text_t name);
/* Sets a value from a word without checking its range. Returns GC_E_NUMBER or GC_E_ARGUMENT if the word is no such value. `parts`
   is the list of the device, which ends with NULL; NULL = it has none. */
int gc_settings_parse(gc_settings_t *settings, gc_setting_t row, gc_text_t word, const gc_part_t *const *parts);
/* Adds name=value. */
void gc_settings_field(gc_sentence_t *s, const gc_settings_t *settings, gc_setting_t row, const gc_part_t *const *parts);
/* Returns the part that was set, or NULL if its id tells. */
const gc_part_t *gc_settings_part(const gc_settings_t *settings, const gc_part_t *const *parts);
/* Checks the table's ranges and the abilities of the part and of the port's bus. Returns GC_OK, GC_E_ARGUMENT, GC_E_FIFO_RATE,
   GC_E_FIFO_NEEDED or GC_E_SPI_NEEDED. */
int gc_settings_check(const gc_settings_t *settings, const gc_part_t *part, const gc_port_t *port);

/* Loads the settings that were kept, whatever the part is that they were made for. Leaves them as they are if there are none, or if
   they name a part that the list does not have. */
void gc_settings_load(gc_kept_settings_t *settings, const gc_port_t *port, const gc_part_t *const *parts);
/* Returns GC_E_STORE if the board has a store and it failed. */
int gc_settings_save(gc_kept_settings_t *settings, const gc_port_t *port);

#ifdef __cplusplus
}
#endif

#endif
