/* An MPU-6050, MPU-6500 or MPU-9250 as seen from its bus, written apart from the driver from the register map RM-MPU-6000A-00, so
   that each checks the other. Strict where the map promises nothing: what is written while the part resets or sleeps is lost. */
#ifndef EMUL_MPU6050_H
#define EMUL_MPU6050_H

#include "emul_world.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    uint8_t reg[128];
    int16_t world[EMUL_WORDS];
    double world_full_scale_dps;
    int16_t inside[EMUL_WORDS]; /* the newest sample; a burst reads the one that was there at its start */
    uint8_t id;          /* set before power-on; 0 = the MPU-6050's */
    uint64_t boot_us;    /* no answer before */
    uint64_t reset_us;   /* DEVICE_RESET reads 1 until then */
    uint64_t gyro_us;    /* the gyroscope runs from then on; it reads 0 before, and its clock cannot be chosen */
    bool by_gyro;        /* the gyroscope's clock was chosen when it ran */
    uint64_t moved_us;   /* the self-test has moved the masses from then on */
    double tick_us;      /* next sample by its own clock */
    double clock;        /* ratio of its clock to the nominal one, set before power-on; 0 = nominal */
    bool fed_only;
    bool nack, wrong_id, stale, stuck_bit, stuck_reset; /* misbehaviour */
    uint8_t stuck_axes;
    bool no_code;
} emul_mpu6050_t;

double emul_mpu6050_clock_for(double rate_hz);
void emul_mpu6050_power_on(emul_mpu6050_t *chip, uint64_t now_us, double world_full_scale_dps);
void emul_mpu6050_brown_out(emul_mpu6050_t *chip);
void emul_mpu6050_feed(emul_mpu6050_t *chip, uint64_t now_us, const int16_t world[EMUL_WORDS]);
bool emul_mpu6050_batches(const emul_mpu6050_t *chip);
/* Returns the level of the pin INT. */
bool emul_mpu6050_int1(const emul_mpu6050_t *chip);
/* Returns the low-pass of the gyroscope that is in use, as emul.h says. */
int emul_mpu6050_low_pass(const emul_mpu6050_t *chip);
/* Whether its registers say that it takes no bus for I2C. */
bool emul_mpu6050_i2c_off(const emul_mpu6050_t *chip);
void emul_mpu6050_advance(emul_mpu6050_t *chip, uint64_t now_us);
int emul_mpu6050_write(emul_mpu6050_t *chip, uint64_t now_us, uint8_t reg, const uint8_t *data, size_t n);
int emul_mpu6050_read(emul_mpu6050_t *chip, uint64_t now_us, uint8_t reg, uint8_t *data, size_t n);

#endif
