/* The simulator's command line. */
#ifndef OPTIONS_H
#define OPTIONS_H

#include "emul.h"
#include "faults.h"
#include "gc_sensor.h"

#include <stdbool.h>

#define OPTIONS_USAGE                                                                                                    \
    "usage: gyrocal-sim ROWS [--speed X|max] [--imu N] [--stream raw|packed|off] [--fifo N] [--hold] [--bench] [--idle S] "               \
    "[--sleep MS] [--clock US] [--seq N] [--sensor NAME|list] [--bus i2c|spi] [--fault NAME[@T][:LENGTH][*TIMES]|list]..."

typedef struct {
    const char *path; /* path of the ROWS file */
    double speed;     /* virtual seconds per second; 0 = as fast as the reader accepts them */
    double idle_s;    /* the device also runs between the runs, and for so long after the last one of a power cycle; 0 = not */
    unsigned imu, fifo;
    const emul_kind_t *sensor; /* LSM6DSO if not given, and */
    const gc_part_t *driver;   /* its driver's part, and */
    const gc_part_t *told;     /* that part where the id would tell another; else NULL */
    uint64_t sleep_us; /* the core does not run for so long after each reading, as in light sleep; 0 = the board does not sleep */
    uint64_t clock_us; /* of the board's clock at each power-on */
    uint32_t seq;      /* of the sentence after the first $HEL of each power cycle; 0 = 1, as on a board */
    bool hold, spi;
    const char *stream; /* off if not given */
    bool bench; /* nothing is replayed: at rest, with the noise of a sensor and flash, it answers commands */
    bool list_faults, list_sensors; /* do nothing else */
    faults_t faults;
} options_t;

/* Returns NULL, or a description of the error. */
const char *options_parse(options_t *options, int argc, char **argv);
/* Writes the list that was asked for. Returns false if none was. */
bool options_list(const options_t *options, FILE *to);

#endif
