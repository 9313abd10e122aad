/* Faults on demand: which of them are on at a time, from specifications NAME[@T][:LENGTH][*TIMES].
 *
 * T and LENGTH are in seconds. T counts from the first sample of the first run, across power cycles; without it a passing fault
 * begins at 1 s and a lasting one at power-on. Repetitions are one second apart.
 */
#ifndef FAULTS_H
#define FAULTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#define FAULTS_MAX 32u /* of specifications */

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
    FAULT_KINDS
} fault_kind_t;

typedef struct {
    fault_kind_t kind;
    double at_s, length_s;
    unsigned times;
    unsigned begun; /* how many of them have been dealt with, for fault_begins */
} fault_t;

#define FAULTS_WORDS 7 /* of a reading: temperature, gyroscope x y z, accelerometer x y z */

typedef struct {
    unsigned n;
    fault_t fault[FAULTS_MAX];
    bool turned_over;           /* the sensor, by an early flip, until the run is over */
    int16_t held[FAULTS_WORDS]; /* the last reading */
    unsigned readings;
    uint32_t dice;
} faults_t;

/* Returns NULL, or what is wrong with the specification. */
const char *faults_add(faults_t *faults, const char *specification);
bool faults_has(const faults_t *faults, fault_kind_t kind);
bool faults_on(const faults_t *faults, fault_kind_t kind, double t_s);
/* True once for each time that the fault begins; *length_s is how long that one lasts. */
bool faults_begins(faults_t *faults, fault_kind_t kind, double t_s, double *length_s);
/* What a reading becomes: raw counts; axis 0 x, 1 y, 2 z is the table's. */
void faults_change_reading(faults_t *faults, double t_s, int axis, int16_t reading[FAULTS_WORDS]);
/* Changes a bit of one line in four, before its end. */
void faults_garble(faults_t *faults, char *line, size_t n);
/* Writes a line for each kind: name, tab, what happens. */
void faults_list(FILE *to);

#endif
