#include "faults.h"

#include "gc_error.h"
#include "gc_format.h"

#include <math.h>
#include <string.h>

#define FROM_S 1.0
#define APART_S 1.0
#define LONGEST_S 1e6
#define MOST_TIMES 1000u
#define TABLE_OFF 1.2
#define SPIKE_COUNTS 17143.0 /* 150 dps at a full scale of 250 dps */
#define SPIKE_READINGS 50u
#define GARBLED_ONE_IN 4u

static const struct {
    const char *name;
    const char *means;
    double length_s; /* by default; INFINITY: it lasts */
    bool from_power_on; /* by default */
} kinds[FAULT_KINDS] = {
    [FAULT_NACK] = {"nack", "the sensor does not answer for 0.2 s", 0.2, false},
    [FAULT_WRONG_ID] = {"wrong_id", "another part answers", INFINITY, true},
    [FAULT_STALE] = {"stale", "no new samples for 0.3 s", 0.3, false},
    [FAULT_BROWNOUT] = {"brownout", "the registers fall back to their defaults", 0.0, false},
    [FAULT_STUCK_BIT] = {"stuck_bit", "bit 2 of the rates is always 1", INFINITY, true},
    [FAULT_RESET_TIMEOUT] = {"reset_timeout", "the part does not come out of reset", INFINITY, true},
    [FAULT_BAD_TAGS] = {"bad_tags", "the FIFO's words come damaged for 0.3 s; needs --fifo", 0.3, false},
    [FAULT_BUSY] = {"busy", "the board does something else for 3 s", 3.0, false},
    [FAULT_STUCK_BUS] = {"stuck_bus", "the data line is held low for 0.3 s: bytes read 0, writes do nothing", 0.3, false},
    [FAULT_SHORT_READ] = {"short_read", "each transfer gives one byte too few for 0.2 s", 0.2, false},
    [FAULT_FROZEN] = {"frozen", "the reading does not change for 1 s, with data-ready", 1.0, false},
    [FAULT_REPEATED] = {"repeated", "every second sample is the one before it, for 2 s", 2.0, false},
    [FAULT_SPIKES] = {"spikes", "one reading in 50 is 17143 counts (150 dps at 250 dps full scale) too high, for 1 s", 1.0, false},
    [FAULT_CLIPPING] = {"clipping", "the rate reads full scale for 0.2 s", 0.2, false},
    [FAULT_TABLE_OFF] = {"table_off", "the table turns 20 percent faster than it should", INFINITY, true},
    [FAULT_EARLY_FLIP] = {"early_flip", "the sensor is turned over before its run has ended", 0.0, false},
    [FAULT_REVERSED_MOUNT] = {"reversed_mount", "the sensor is mounted upside down", INFINITY, true},
    [FAULT_GARBLED] = {"garbled", "one line in four comes with a damaged byte, for 1 s", 1.0, false},
    [FAULT_BUFFER_FULL] = {"buffer_full", "the output takes nothing for 0.5 s", 0.5, false},
    [FAULT_CLOCK_JUMP] = {"clock_jump", "the board's clock jumps ahead by 0.5 s", 0.5, false},
    [FAULT_POWER_LOSS] = {"power_loss", "the power goes while the board writes its flash, and comes back", 0.0, false},
    [FAULT_STUCK_MASS] = {"stuck_mass", "the sensor's self-test moves nothing", INFINITY, true},
    [FAULT_UNHEARD] = {"unheard", "nobody reads the USB port until 3 s: it takes 4 KiB and then nothing", 3.0, true},
    [FAULT_HANG] = {"hang", "the board's program hangs, and its watchdog starts it again after 10 s", 0.0, false},
    [FAULT_SUPPLY] = {"supply", "the board's supply breaks down, and it starts again", 0.0, false},
    [FAULT_FLASH_FAILS] = {"flash_fails", "the flash writes half of a record and fails", INFINITY, true},
};

static const char *parse_number(const char **text, double least, double most, double *value) {
    const size_t n = strcspn(*text, "@:*");
    if (gc_parse_real(*text, n, value) != GC_OK || !(*value >= least && *value <= most)) {
        return "a fault is NAME[@T][:LENGTH][*TIMES], T and LENGTH in seconds";
    }
    *text += n;
    return NULL;
}

const char *faults_add(faults_t *faults, const char *specification) {
    fault_t fault = {.kind = FAULT_KINDS, .times = 1u};
    const size_t n = strcspn(specification, "@:*");
    for (unsigned k = 0; k < FAULT_KINDS; k++) {
        if (strlen(kinds[k].name) == n && memcmp(kinds[k].name, specification, n) == 0) {
            fault.kind = (fault_kind_t)k;
        }
    }
    if (fault.kind == FAULT_KINDS) {
        return "no such fault, see --fault list";
    }
    if (faults->n == FAULTS_MAX) {
        return "too many faults";
    }
    const char *text = specification + n;
    const char *wrong = NULL;
    double times = 1.0;
    fault.length_s = kinds[fault.kind].length_s;
    fault.at_s = kinds[fault.kind].from_power_on ? -INFINITY : FROM_S;
    if (*text == '@') {
        text++;
        wrong = parse_number(&text, 0.0, LONGEST_S, &fault.at_s);
    }
    if (wrong == NULL && *text == ':') {
        text++;
        wrong = parse_number(&text, 0.0, LONGEST_S, &fault.length_s);
    }
    if (wrong == NULL && *text == '*') {
        text++;
        wrong = parse_number(&text, 1.0, MOST_TIMES, &times);
    }
    if (wrong != NULL || *text != '\0' || times != floor(times)) {
        return "a fault is NAME[@T][:LENGTH][*TIMES], T and LENGTH in seconds";
    }
    fault.times = (unsigned)times;
    faults->fault[faults->n++] = fault;
    return NULL;
}

bool faults_has(const faults_t *faults, fault_kind_t kind) {
    for (unsigned i = 0; i < faults->n; i++) {
        if (faults->fault[i].kind == kind) {
            return true;
        }
    }
    return false;
}

/* A fault that is there from power-on counts its length from the first sample. */
static double counted_from_s(const fault_t *fault) {
    return isinf(fault->at_s) ? 0.0 : fault->at_s;
}

static double beginning_s(const fault_t *fault, unsigned time) {
    return time == 0u ? fault->at_s : counted_from_s(fault) + time * (fault->length_s + APART_S);
}

static double end_s(const fault_t *fault, unsigned time) {
    return counted_from_s(fault) + fault->length_s + (time == 0u ? 0.0 : time * (fault->length_s + APART_S));
}

bool faults_on(const faults_t *faults, fault_kind_t kind, double t_s) {
    for (unsigned i = 0; i < faults->n; i++) {
        const fault_t *fault = &faults->fault[i];
        for (unsigned k = 0; fault->kind == kind && k < fault->times; k++) {
            if (t_s >= beginning_s(fault, k) && t_s < end_s(fault, k)) {
                return true;
            }
        }
    }
    return false;
}

bool faults_begins(faults_t *faults, fault_kind_t kind, double t_s, double *length_s) {
    for (unsigned i = 0; i < faults->n; i++) {
        fault_t *fault = &faults->fault[i];
        if (fault->kind == kind && fault->begun < fault->times && t_s >= beginning_s(fault, fault->begun)) {
            fault->begun++;
            *length_s = fault->length_s;
            return true;
        }
    }
    return false;
}

void faults_change_reading(faults_t *faults, double t_s, int axis, int16_t reading[FAULTS_WORDS]) {
    int16_t *rate = &reading[1 + axis], *acc = &reading[4 + axis];
    double value = *rate;
    value *= faults_on(faults, FAULT_TABLE_OFF, t_s) ? TABLE_OFF : 1.0;
    if (faults_on(faults, FAULT_REVERSED_MOUNT, t_s) != faults->turned_over) {
        value = -value;
        *acc = (int16_t)(*acc == INT16_MIN ? INT16_MAX : -*acc);
    }
    value += faults_on(faults, FAULT_SPIKES, t_s) && faults->readings % SPIKE_READINGS == 0u ? SPIKE_COUNTS : 0.0;
    value = faults_on(faults, FAULT_CLIPPING, t_s) ? copysign(INT16_MAX, value) : value;
    *rate = (int16_t)rint(fmin(fmax(value, INT16_MIN), INT16_MAX));
    const bool again = faults_on(faults, FAULT_REPEATED, t_s) && faults->readings % 2u == 1u;
    if (again || faults_on(faults, FAULT_FROZEN, t_s)) {
        memcpy(reading, faults->held, sizeof faults->held);
    }
    memcpy(faults->held, reading, sizeof faults->held);
    faults->readings++;
}

void faults_garble(faults_t *faults, char *line, size_t n) {
    faults->dice = faults->dice * 1664525u + 1013904223u;
    const uint32_t number = faults->dice >> 16;
    if (n > 1u && number % GARBLED_ONE_IN == 0u) {
        char *byte = &line[number / GARBLED_ONE_IN % (n - 1u)];
        *byte = (char)(*byte ^ 0x40);
    }
}

void faults_list(FILE *to) {
    for (unsigned k = 0; k < FAULT_KINDS; k++) {
        fprintf(to, "%s\t%s\n", kinds[k].name, kinds[k].means);
    }
}
