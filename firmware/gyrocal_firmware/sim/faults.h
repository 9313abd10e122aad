/* Determines which faults are active at a time, from specifications NAME[@T][:LENGTH][*TIMES].
 *
 * T and LENGTH are in seconds. T counts from the first sample of the first run, across power cycles; without it a fault
 * begins at 1 s or, if it is of that kind, at power-on, and its LENGTH then counts from the first sample. Repetitions are one second apart.
 */
#ifndef FAULTS_H
#define FAULTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#define FAULTS_MAX 32u /* number of specifications */

typedef enum {
    FAULT_NACK,
    FAULT_WRONG_ID,
    FAULT_STALE,
    FAULT_BROWNOUT,
    FAULT_STUCK_BIT,
    FAULT_RESET_TIMEOUT,
    FAULT_BAD_TAGS,
    FAULT_BUSY,
    FAULT_STUCK_BUS,
    FAULT_SHORT_READ,
    FAULT_FROZEN,
    FAULT_REPEATED,
    FAULT_SPIKES,
    FAULT_CLIPPING,
    FAULT_TABLE_OFF,
    FAULT_EARLY_FLIP,
    FAULT_REVERSED_MOUNT,
    FAULT_GARBLED,
    FAULT_BUFFER_FULL,
    FAULT_CLOCK_JUMP,
    FAULT_POWER_LOSS,
    FAULT_STUCK_MASS,
    FAULT_UNHEARD,
    FAULT_HANG,
    FAULT_SUPPLY,
    FAULT_FLASH_FAILS,
    FAULT_KINDS
} fault_kind_t;

typedef struct {
    fault_kind_t kind;
    double at_s, length_s;
    unsigned times;
    unsigned begun; /* number of repetitions that fault_begins has reported */
} fault_t;

#define FAULTS_WORDS 7 /* of a reading: temperature, gyroscope x y z, accelerometer x y z */

typedef struct {
    unsigned n;
    fault_t fault[FAULTS_MAX];
    bool turned_over;           /* an early flip has turned the sensor until the end of the run */
    int16_t held[FAULTS_WORDS]; /* the last reading */
    unsigned readings;
    uint32_t dice;
} faults_t;

/* Returns NULL, or a description of the error in the specification. */
const char *faults_add(faults_t *faults, const char *specification);
bool faults_has(const faults_t *faults, fault_kind_t kind);
bool faults_on(const faults_t *faults, fault_kind_t kind, double t_s);
/* Returns true once for each repetition of the fault. *length_s receives its duration, s. */
bool faults_begins(faults_t *faults, fault_kind_t kind, double t_s, double *length_s);
/* Applies the active faults to a reading in raw counts. axis is that of the table: 0 x, 1 y, 2 z. */
void faults_change_reading(faults_t *faults, double t_s, int axis, int16_t reading[FAULTS_WORDS]);
/* Changes one bit of one line in four, except of its line end. */
void faults_garble(faults_t *faults, char *line, size_t n);
/* Writes a line for each kind: name, tab, what happens. */
void faults_list(FILE *to);

#endif
