/* An LSM6DSV as seen from its bus, written apart from the driver, so that each checks the other. Strict: a reset while a sensor runs or
   INT1 is high does not end, and a bit that switches off the bus does. */
#ifndef EMUL_LSM6DSV_H
#define EMUL_LSM6DSV_H

#include "emul_world.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define EMUL_LSM6DSV_WORDS 256
#define EMUL_LSM6DSV_WORD_BYTES 7 /* tag and six bytes */

typedef struct {
    uint8_t reg[128];
    int16_t world[EMUL_WORDS];
    double world_full_scale_dps;
    int16_t inside[EMUL_WORDS]; /* the newest sample; a burst reads the one that was there at its start */
    uint8_t fifo[EMUL_LSM6DSV_WORDS][EMUL_LSM6DSV_WORD_BYTES];
    unsigned fifo_first, fifo_n, slot;
    unsigned stamped;    /* slots since the last stamp of the time */
    double acc_due, temp_due; /* shares of the next words that are due */
    uint64_t boot_us;    /* no answer before */
    uint64_t reset_us;   /* SW_RESET reads 1 until then */
    uint64_t gyro_us;    /* the gyroscope reads 0 before */
    double tick_us;      /* next sample by its own clock */
    double clock;        /* ratio of its clock to the nominal one, set before power-on; 0 = nominal */
    bool fed_only;
    bool nack, wrong_id, stale, stuck_bit, stuck_reset, bad_tags; /* misbehaviour */
    uint8_t stuck_axes;
} emul_lsm6dsv_t;

double emul_lsm6dsv_clock_for(double rate_hz);
void emul_lsm6dsv_power_on(emul_lsm6dsv_t *chip, uint64_t now_us, double world_full_scale_dps);
void emul_lsm6dsv_brown_out(emul_lsm6dsv_t *chip);
void emul_lsm6dsv_feed(emul_lsm6dsv_t *chip, uint64_t now_us, const int16_t world[EMUL_WORDS]);
bool emul_lsm6dsv_batches(const emul_lsm6dsv_t *chip);
/* Returns the level of the pin INT1. */
bool emul_lsm6dsv_int1(const emul_lsm6dsv_t *chip);
/* Returns the low-pass of the gyroscope that is in use, as emul.h says. */
int emul_lsm6dsv_low_pass(const emul_lsm6dsv_t *chip);
/* Whether its registers say that it takes no bus for I2C. */
bool emul_lsm6dsv_i2c_off(const emul_lsm6dsv_t *chip);
void emul_lsm6dsv_advance(emul_lsm6dsv_t *chip, uint64_t now_us);
int emul_lsm6dsv_write(emul_lsm6dsv_t *chip, uint64_t now_us, uint8_t reg, const uint8_t *data, size_t n);
int emul_lsm6dsv_read(emul_lsm6dsv_t *chip, uint64_t now_us, uint8_t reg, uint8_t *data, size_t n);

#endif
