/* An ICM-20948 as seen from its bus, written apart from the driver, so that each checks the other. Strict where nothing is promised:
   what is written while the part resets or sleeps, or to a register of a bank that is not selected, is lost. */
#ifndef EMUL_ICM20948_H
#define EMUL_ICM20948_H

#include "emul_world.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    uint8_t reg[4][128]; /* by bank */
    uint8_t bank;
    int16_t world[EMUL_WORDS];
    double world_full_scale_dps;
    int16_t inside[EMUL_WORDS]; /* the newest sample; a burst reads the one that was there at its start */
    uint64_t boot_us;    /* no answer before */
    uint64_t reset_us;   /* DEVICE_RESET reads 1 until then */
    uint64_t gyro_us;    /* the gyroscope reads 0 before */
    uint64_t moved_us;   /* the self-test has moved the masses from then on */
    double tick_us;      /* next sample by its own clock */
    double clock;        /* ratio of its clock to the nominal one, set before power-on; 0 = nominal */
    bool fed_only;
    bool nack, wrong_id, stale, stuck_bit, stuck_reset; /* misbehaviour */
    uint8_t stuck_axes;
    bool no_code;
} emul_icm20948_t;

double emul_icm20948_clock_for(double rate_hz);
void emul_icm20948_power_on(emul_icm20948_t *chip, uint64_t now_us, double world_full_scale_dps);
void emul_icm20948_brown_out(emul_icm20948_t *chip);
void emul_icm20948_feed(emul_icm20948_t *chip, uint64_t now_us, const int16_t world[EMUL_WORDS]);
bool emul_icm20948_batches(const emul_icm20948_t *chip);
/* Returns the level of the pin INT1. */
bool emul_icm20948_int1(const emul_icm20948_t *chip);
/* Returns the low-pass of the gyroscope that is in use, as emul.h says. */
int emul_icm20948_low_pass(const emul_icm20948_t *chip);
/* Whether its registers say that it takes no bus for I2C. */
bool emul_icm20948_i2c_off(const emul_icm20948_t *chip);
void emul_icm20948_advance(emul_icm20948_t *chip, uint64_t now_us);
int emul_icm20948_write(emul_icm20948_t *chip, uint64_t now_us, uint8_t reg, const uint8_t *data, size_t n);
int emul_icm20948_read(emul_icm20948_t *chip, uint64_t now_us, uint8_t reg, uint8_t *data, size_t n);

#endif
