/* The simulator's command line. */
#ifndef OPTIONS_H
#define OPTIONS_H

#include "faults.h"

#include <stdbool.h>

#define OPTIONS_USAGE                                                                                                    \
    "usage: gyrocal-sim ROWS [--speed X|max] [--imu N] [--stream raw|off] [--fifo N] [--hold] "                          \
    "[--fault NAME[@T][:LENGTH][*TIMES]|list]..."

typedef struct {
    const char *path; /* of the ROWS file */
    double speed;     /* virtual seconds a second; 0 = as fast as the reader takes it */
    unsigned imu, fifo;
    bool stream, hold;
    bool list; /* the faults, and no more */
    faults_t faults;
} options_t;

/* Returns NULL, or what is wrong. */
const char *options_parse(options_t *options, int argc, char **argv);

#endif
