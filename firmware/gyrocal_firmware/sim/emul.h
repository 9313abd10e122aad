/* The emulated part of a simulated device: one of the kinds that emul.c lists, behind one interface. emul_lsm6dso.h documents each
   function. */
#ifndef EMUL_H
#define EMUL_H

#include "emul_bmi088.h"
#include "emul_bmi270.h"
#include "emul_icm20948.h"
#include "emul_icm42688.h"
#include "emul_lsm6dso.h"
#include "emul_lsm6dsv.h"
#include "emul_mpu6050.h"

typedef struct {
    bool nack, wrong_id, stale, stuck_bit, stuck_reset, bad_tags;
    bool no_code; /* the factory's codes of the self-test are missing */
    uint8_t stuck_axes; /* of which the self-test moves nothing, a bit each */
} emul_faults_t;

/* The functions of a family of parts. */
typedef struct {
    void (*power_on)(void *chip, uint8_t id, bool is_32, double clock, uint64_t now_us, double world_full_scale_dps);
    void (*brown_out)(void *chip);
    void (*set_faults)(void *chip, const emul_faults_t *faults);
    void (*set_fed_only)(void *chip, bool fed_only);
    void (*set_world)(void *chip, const int16_t world[EMUL_WORDS]);
    void (*feed)(void *chip, uint64_t now_us, const int16_t world[EMUL_WORDS]);
    bool (*batches)(const void *chip);
    bool (*int1)(const void *chip);
    double (*tick_us)(const void *chip);
    void (*advance)(void *chip, uint64_t now_us);
    int (*write)(void *chip, uint64_t now_us, uint8_t reg, const uint8_t *data, size_t n);
    int (*read)(void *chip, uint64_t now_us, uint8_t reg, uint8_t *data, size_t n);
    double (*clock_for)(double rate_hz);
    int (*low_pass)(const void *chip);
    bool (*i2c_off)(const void *chip);
} emul_family_t;

/* How a kind speaks SPI, by its datasheet; all that do take modes 0 and 3. Of each die: bytes before what is read, and whether it
   answers nothing before it was asked for SPI. */
typedef struct {
    uint32_t most_hz;
    unsigned dies, dummies[2];
    bool asked_for[2];
} emul_spi_t;

typedef struct {
    const char *name; /* as the driver calls it */
    const emul_family_t *family;
    uint8_t address, id;
    bool is_32;
    uint8_t other_address; /* of a second die; 0 = there is none */
    const emul_spi_t *spi; /* NULL = it has none */
} emul_kind_t;

typedef struct {
    const emul_kind_t *kind;
    uint8_t address; /* 0 = that of its kind */
    bool speaks_spi[2];  /* the chip selects of its dies have risen since power-on, and since a reset where that takes it back */
    unsigned spi_faults; /* transfers by SPI that its maker does not allow */
    union {
        emul_lsm6dso_t lsm6dso;
        emul_mpu6050_t mpu6050;
        emul_icm42688_t icm42688;
        emul_icm20948_t icm20948;
        emul_bmi270_t bmi270;
        emul_bmi088_t bmi088;
        emul_lsm6dsv_t lsm6dsv;
    } chip;
} emul_t;

/* The kinds; the last one has no name. */
extern const emul_kind_t emul_kinds[];

/* Returns NULL for an unknown name. */
const emul_kind_t *emul_kind(const char *name);

/* kind must be set. clock as in emul_lsm6dso_t. */
void emul_power_on(emul_t *emul, double clock, uint64_t now_us, double world_full_scale_dps);
void emul_brown_out(emul_t *emul);
void emul_set_faults(emul_t *emul, const emul_faults_t *faults);
void emul_set_fed_only(emul_t *emul, bool fed_only);
/* Sets the values to measure from the next sample on; emul_feed samples them at once. */
void emul_set_world(emul_t *emul, const int16_t world[EMUL_WORDS]);
void emul_feed(emul_t *emul, uint64_t now_us, const int16_t world[EMUL_WORDS]);
bool emul_batches(const emul_t *emul);
bool emul_int1(const emul_t *emul);
/* Returns the time of the next sample by the part's own clock. */
double emul_tick_us(const emul_t *emul);
void emul_advance(emul_t *emul, uint64_t now_us);
/* Whether one of its dies has the address. */
bool emul_is_at(const emul_t *emul, uint8_t address);
/* Return -1 if no die of it answers at the address. */
int emul_write(emul_t *emul, uint64_t now_us, uint8_t address, uint8_t reg, const uint8_t *data, size_t n);
int emul_read(emul_t *emul, uint64_t now_us, uint8_t address, uint8_t reg, uint8_t *data, size_t n);
/* Whether its registers say that it takes no bus for I2C. On I2C it then answers nothing. */
bool emul_i2c_off(const emul_t *emul);
/* Pass on what a bus has taken apart: emul_write and emul_read by die, whatever the bus. */
int emul_write_die(emul_t *emul, uint64_t now_us, unsigned die, uint8_t reg, const uint8_t *data, size_t n);
int emul_read_die(emul_t *emul, uint64_t now_us, unsigned die, uint8_t reg, uint8_t *data, size_t n);
/* The file that an emulated part wants at its start, for gc_port_t; NULL if it wants none. */
const uint8_t *emul_part_file(const char *part, size_t *n);
/* Returns the gyroscope's low-pass that its registers choose, as the maker numbers it; -1 = one that the part does not have. */
int emul_low_pass(const emul_t *emul);
double emul_clock_for(const emul_t *emul, double rate_hz);

#endif
