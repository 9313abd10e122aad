/* A BMI270 as seen from its bus, written apart from the driver, so that each checks the other. Strict: it measures nothing before its
   file was written to it whole and in order, what is written in suspend too soon after another write is lost, and a FIFO that was
   full says so once. Its file is not Bosch's but one of as many bytes that anybody may have. */
#ifndef EMUL_BMI270_H
#define EMUL_BMI270_H

#include "emul_world.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define EMUL_BMI270_FRAMES 170 /* of a FIFO of 2 KB */
#define EMUL_BMI270_FRAME_BYTES 12
#define EMUL_BMI270_FILE_BYTES 8192

typedef struct {
    uint8_t reg[128];
    int16_t world[EMUL_WORDS];
    double world_full_scale_dps;
    int16_t inside[EMUL_WORDS]; /* the newest sample; a burst reads the one that was there at its start */
    uint8_t file[EMUL_BMI270_FILE_BYTES]; /* as it was written */
    uint8_t fifo[EMUL_BMI270_FRAMES][EMUL_BMI270_FRAME_BYTES];
    unsigned fifo_first, fifo_n, fifo_byte; /* frames, and the next byte of the first one */
    uint64_t boot_us;    /* no answer before */
    uint64_t reset_us;   /* no answer before, after a reset */
    uint64_t deaf_us;    /* nothing is written before */
    uint64_t loaded_us;  /* the file works from then on; 0 = none was accepted */
    uint64_t gyro_us;    /* the gyroscope reads 0 before */
    uint8_t trigger[2];  /* the word of page 1 that chooses what a trigger begins */
    uint8_t test_status; /* why it was not begun */
    uint64_t gyro_off_us; /* the gyroscope is at rest from then on */
    uint64_t test_us;    /* the self-test goes on until then; 0 = none was begun */
    double tick_us;      /* next sample by its own clock */
    double clock;        /* ratio of its clock to the nominal one, set before power-on; 0 = nominal */
    bool fed_only;
    bool nack, wrong_id, stale, stuck_bit, stuck_reset; /* misbehaviour */
    uint8_t stuck_axes;
} emul_bmi270_t;

/* The file that it wants. */
const uint8_t *emul_bmi270_file(size_t *n);
double emul_bmi270_clock_for(double rate_hz);
void emul_bmi270_power_on(emul_bmi270_t *chip, uint64_t now_us, double world_full_scale_dps);
void emul_bmi270_brown_out(emul_bmi270_t *chip);
void emul_bmi270_feed(emul_bmi270_t *chip, uint64_t now_us, const int16_t world[EMUL_WORDS]);
bool emul_bmi270_batches(const emul_bmi270_t *chip);
/* Returns the level of the pin INT1. */
bool emul_bmi270_int1(const emul_bmi270_t *chip);
/* Returns the low-pass of the gyroscope that is in use, as emul.h says. */
int emul_bmi270_low_pass(const emul_bmi270_t *chip);
bool emul_bmi270_i2c_off(const emul_bmi270_t *chip);
void emul_bmi270_advance(emul_bmi270_t *chip, uint64_t now_us);
int emul_bmi270_write(emul_bmi270_t *chip, uint64_t now_us, uint8_t reg, const uint8_t *data, size_t n);
int emul_bmi270_read(emul_bmi270_t *chip, uint64_t now_us, uint8_t reg, uint8_t *data, size_t n);

#endif
