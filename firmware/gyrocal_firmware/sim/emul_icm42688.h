/* An ICM-42688-P as seen from its bus, written apart from the driver, so that each checks the other. Strict: what is written while
   the part resets or within 200 us after PWR_MGMT0 is lost, and there is no interrupt before INT_ASYNC_RESET was cleared. */
#ifndef EMUL_ICM42688_H
#define EMUL_ICM42688_H

#include "emul_world.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    uint8_t reg[128]; /* of bank 0 */
    uint8_t bank;
    int16_t world[EMUL_WORDS];
    double world_full_scale_dps;
    int16_t inside[EMUL_WORDS]; /* the newest sample; a burst reads the one that was there at its start */
    uint64_t boot_us;    /* no answer before */
    uint64_t reset_us;   /* the reset goes on until then; 0 = none does */
    uint64_t deaf_us;    /* nothing is written before */
    uint64_t gyro_us;    /* the gyroscope reads 0 before */
    uint64_t moved_us;   /* the self-test has moved the masses from then on */
    double tick_us;      /* next sample by its own clock */
    double clock;        /* ratio of its clock to the nominal one, set before power-on; 0 = nominal */
    bool fed_only;
    bool nack, wrong_id, stale, stuck_bit, stuck_reset; /* misbehaviour */
    uint8_t stuck_axes;
    bool no_code;
} emul_icm42688_t;

double emul_icm42688_clock_for(double rate_hz);
void emul_icm42688_power_on(emul_icm42688_t *chip, uint64_t now_us, double world_full_scale_dps);
void emul_icm42688_brown_out(emul_icm42688_t *chip);
void emul_icm42688_feed(emul_icm42688_t *chip, uint64_t now_us, const int16_t world[EMUL_WORDS]);
bool emul_icm42688_batches(const emul_icm42688_t *chip);
/* Returns the level of the pin INT1. */
bool emul_icm42688_int1(const emul_icm42688_t *chip);
/* Returns the low-pass of the gyroscope that is in use, as emul.h says. */
int emul_icm42688_low_pass(const emul_icm42688_t *chip);
/* Whether its registers say that it takes no bus for I2C. */
bool emul_icm42688_i2c_off(const emul_icm42688_t *chip);
void emul_icm42688_advance(emul_icm42688_t *chip, uint64_t now_us);
int emul_icm42688_write(emul_icm42688_t *chip, uint64_t now_us, uint8_t reg, const uint8_t *data, size_t n);
int emul_icm42688_read(emul_icm42688_t *chip, uint64_t now_us, uint8_t reg, uint8_t *data, size_t n);

#endif
