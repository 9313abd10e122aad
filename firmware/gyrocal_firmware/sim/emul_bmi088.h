/* A BMI088 as seen from its bus, written apart from the driver, so that each checks the other: two dies, of which the accelerometer's
   registers have bit 7 set here. Strict: a die that resets does not answer, the accelerometer takes no settings in suspend and
   measures only when it was woken in the right order, and data-ready shows for 280 us. */
#ifndef EMUL_BMI088_H
#define EMUL_BMI088_H

#include "emul_world.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define EMUL_BMI088_FRAMES 100

typedef struct {
    uint8_t reg[256]; /* the gyroscope's, then the accelerometer's */
    int16_t world[EMUL_WORDS];
    double world_full_scale_dps;
    int16_t inside[EMUL_WORDS]; /* the newest sample */
    int16_t fifo[EMUL_BMI088_FRAMES][3];
    unsigned fifo_first, fifo_n, fifo_byte; /* frames, and the next byte of the first one */
    bool fifo_overrun;
    uint64_t boot_us;      /* no answer before */
    uint64_t reset_us[2];  /* no answer of this die before */
    uint64_t acc_us;       /* the accelerometer takes settings from then on; UINT64_MAX = it is off */
    uint64_t gyro_us;      /* the gyroscope reads 0 before */
    uint64_t now_us, sampled_us;
    uint64_t test_us;      /* the self-test is ready then; 0 = none was begun */
    double tick_us;        /* next sample by its own clock */
    double clock;          /* ratio of its clock to the nominal one, set before power-on; 0 = nominal */
    bool fed_only;
    bool nack, wrong_id, stale, stuck_bit, stuck_reset; /* misbehaviour */
    uint8_t stuck_axes;
} emul_bmi088_t;

double emul_bmi088_clock_for(double rate_hz);
void emul_bmi088_power_on(emul_bmi088_t *chip, uint64_t now_us, double world_full_scale_dps);
void emul_bmi088_brown_out(emul_bmi088_t *chip);
void emul_bmi088_feed(emul_bmi088_t *chip, uint64_t now_us, const int16_t world[EMUL_WORDS]);
bool emul_bmi088_batches(const emul_bmi088_t *chip);
/* Returns the level of the pin INT3. */
bool emul_bmi088_int1(const emul_bmi088_t *chip);
/* Returns the low-pass of the gyroscope that is in use, as emul.h says. */
int emul_bmi088_low_pass(const emul_bmi088_t *chip);
bool emul_bmi088_i2c_off(const emul_bmi088_t *chip);
void emul_bmi088_advance(emul_bmi088_t *chip, uint64_t now_us);
int emul_bmi088_write(emul_bmi088_t *chip, uint64_t now_us, uint8_t reg, const uint8_t *data, size_t n);
int emul_bmi088_read(emul_bmi088_t *chip, uint64_t now_us, uint8_t reg, uint8_t *data, size_t n);

#endif
