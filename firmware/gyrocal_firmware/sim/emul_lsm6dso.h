/* An LSM6DSO or a relative as seen from its bus: a register file that reacts to what is written to it. Facts from the datasheets,
   written apart from the driver, so that each checks the other. */
#ifndef EMUL_LSM6DSO_H
#define EMUL_LSM6DSO_H

#include "emul_world.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define EMUL_FIFO_WORDS 512
#define EMUL_FIFO_WORD_BYTES 7 /* tag and six bytes */

typedef struct {
    uint8_t reg[128];
    int16_t world[EMUL_WORDS]; /* the true values, in counts at world_full_scale_dps and 2 g */
    double world_full_scale_dps;
    uint8_t id;          /* set before power-on: 0x6B LSM6DSR, 0x6A LSM6DS3TR-C, 0x69 LSM6DS3; 0 = 0x6C, LSM6DSO */
    bool is_32;          /* likewise: the LSM6DSO32, whose id is the LSM6DSO's */
    int16_t out[EMUL_WORDS];
    int16_t next[EMUL_WORDS]; /* waits while a word is half read (BDU) */
    bool half_read[EMUL_WORDS];
    bool waiting[EMUL_WORDS];
    uint64_t boot_us;    /* no answer before */
    uint64_t reset_us;   /* SW_RESET reads 1 until then */
    uint64_t settled_us; /* the gyroscope reads 0 before: its turn-on time */
    double tick_us;      /* next sample by its own clock */
    double clock;        /* ratio of its clock to the nominal one, set before power-on; 0 = nominal */
    bool i3c;            /* INT1 was high at a reset: no answer on I2C until power-off */
    bool spoilt;         /* a bit that must stay 0 was set: nothing is promised any more, so no answer until power-off */
    bool fed_only;       /* its clock is off, and it samples when it is given a value */

    uint8_t fifo[EMUL_FIFO_WORDS][EMUL_FIFO_WORD_BYTES];
    unsigned fifo_first, fifo_n;
    unsigned slot; /* time slots so far; the tag holds the lowest two bits */
    unsigned stamped;  /* slots since the last stamp of the time */
    double batched[3]; /* gyroscope, accelerometer, temperature: share of the next word that is due */

    /* misbehaviour */
    bool nack, wrong_id, stale, stuck_bit, stuck_reset, bad_tags;
    uint8_t stuck_axes;
} emul_lsm6dso_t;

/* The clock, over nominal, at which the nearest output data rate is exactly rate_hz. */
double emul_lsm6dso_clock_for(double rate_hz);
void emul_lsm6dso_power_on(emul_lsm6dso_t *chip, uint64_t now_us, double world_full_scale_dps);
/* Resets the registers to their defaults, as a dip of the supply does. */
void emul_lsm6dso_brown_out(emul_lsm6dso_t *chip);
/* Sets the values to measure from now on and samples them at once, so that a row is read at its own time. */
void emul_lsm6dso_feed(emul_lsm6dso_t *chip, uint64_t now_us, const int16_t world[EMUL_WORDS]);
/* Returns true if samples go to the FIFO. */
bool emul_lsm6dso_batches(const emul_lsm6dso_t *chip);
/* Returns the level of the pin INT1. */
bool emul_lsm6dso_int1(const emul_lsm6dso_t *chip);
/* Takes the samples that are due by the chip's clock until now. */
/* Returns the low-pass of the gyroscope that is in use, as emul.h says. */
int emul_lsm6dso_low_pass(const emul_lsm6dso_t *chip);
/* Whether its registers say that it takes no bus for I2C. */
bool emul_lsm6dso_i2c_off(const emul_lsm6dso_t *chip);
void emul_lsm6dso_advance(emul_lsm6dso_t *chip, uint64_t now_us);
/* Returns the number of bytes transferred, or -1 if the chip does not acknowledge. */
int emul_lsm6dso_write(emul_lsm6dso_t *chip, uint64_t now_us, uint8_t reg, const uint8_t *data, size_t n);
int emul_lsm6dso_read(emul_lsm6dso_t *chip, uint64_t now_us, uint8_t reg, uint8_t *data, size_t n);

#endif
