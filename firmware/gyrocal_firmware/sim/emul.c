#include "emul.h"

#include <string.h>

/* A family's functions with its chip behind a void pointer. */
#define FAMILY(part)                                                                                                     \
    static void part##_brown_out(void *chip) {                                                                           \
        emul_##part##_brown_out(chip);                                                                                   \
    }                                                                                                                    \
    static void part##_set_fed_only(void *chip, bool fed_only) {                                                         \
        ((emul_##part##_t *)chip)->fed_only = fed_only;                                                                  \
    }                                                                                                                    \
    static void part##_set_faults(void *chip, const emul_faults_t *faults) {                                             \
        emul_##part##_t *c = chip;                                                                                       \
        c->nack = faults->nack;                                                                                          \
        c->wrong_id = faults->wrong_id;                                                                                  \
        c->stale = faults->stale;                                                                                        \
        c->stuck_bit = faults->stuck_bit;                                                                                \
        c->stuck_reset = faults->stuck_reset;                                                                            \
        c->stuck_axes = faults->stuck_axes;                                                                              \
        SET_REST_OF_##part(c, faults);                                                                                   \
    }                                                                                                                    \
    static void part##_power_on(void *chip, uint8_t id, bool is_32, double clock, uint64_t now_us, double full_scale) {  \
        emul_##part##_t *c = chip;                                                                                       \
        c->clock = clock;                                                                                                \
        SET_KIND_OF_##part(c, id, is_32);                                                                                \
        emul_##part##_power_on(c, now_us, full_scale);                                                                   \
    }                                                                                                                    \
    static void part##_set_world(void *chip, const int16_t world[EMUL_WORDS]) {                                          \
        memcpy(((emul_##part##_t *)chip)->world, world, EMUL_WORDS * sizeof world[0]);                                   \
    }                                                                                                                    \
    static void part##_feed(void *chip, uint64_t now_us, const int16_t world[EMUL_WORDS]) {                              \
        emul_##part##_feed(chip, now_us, world);                                                                         \
    }                                                                                                                    \
    static bool part##_batches(const void *chip) {                                                                       \
        return emul_##part##_batches(chip);                                                                              \
    }                                                                                                                    \
    static bool part##_int1(const void *chip) {                                                                          \
        return emul_##part##_int1(chip);                                                                                 \
    }                                                                                                                    \
    static double part##_tick_us(const void *chip) {                                                                     \
        return ((const emul_##part##_t *)chip)->tick_us;                                                                 \
    }                                                                                                                    \
    static void part##_advance(void *chip, uint64_t now_us) {                                                            \
        emul_##part##_advance(chip, now_us);                                                                             \
    }                                                                                                                    \
    static int part##_write(void *chip, uint64_t now_us, uint8_t reg, const uint8_t *data, size_t n) {                   \
        return emul_##part##_write(chip, now_us, reg, data, n);                                                          \
    }                                                                                                                    \
    static int part##_read(void *chip, uint64_t now_us, uint8_t reg, uint8_t *data, size_t n) {                          \
        return emul_##part##_read(chip, now_us, reg, data, n);                                                           \
    }                                                                                                                    \
    static int part##_low_pass(const void *chip) {                                                                       \
        return emul_##part##_low_pass(chip);                                                                             \
    }                                                                                                                    \
    static bool part##_i2c_off(const void *chip) {                                                                       \
        return emul_##part##_i2c_off(chip);                                                                              \
    }                                                                                                                    \
    static const emul_family_t part = {part##_power_on, part##_brown_out, part##_set_faults, part##_set_fed_only,        \
                                       part##_set_world, part##_feed, part##_batches, part##_int1, part##_tick_us,       \
                                       part##_advance, part##_write, part##_read, emul_##part##_clock_for, part##_low_pass, part##_i2c_off}

#define SET_REST_OF_lsm6dso(c, faults) (c)->bad_tags = (faults)->bad_tags
#define SET_REST_OF_lsm6dsv SET_REST_OF_lsm6dso
#define SET_REST_OF_bmi088(c, faults) (void)(faults)->bad_tags
#define SET_REST_OF_bmi270 SET_REST_OF_bmi088
#define SET_REST_OF_mpu6050(c, faults) (c)->no_code = (faults)->no_code
#define SET_REST_OF_icm42688 SET_REST_OF_mpu6050
#define SET_REST_OF_icm20948 SET_REST_OF_mpu6050
#define SET_KIND_OF_lsm6dso(c, the_id, the_32) ((c)->id = (the_id), (c)->is_32 = (the_32))
#define SET_KIND_OF_mpu6050(c, the_id, the_32) ((c)->id = (the_id), (void)(the_32))
#define SET_KIND_OF_icm42688(c, the_id, the_32) ((void)(the_id), (void)(the_32))
#define SET_KIND_OF_icm20948 SET_KIND_OF_icm42688
#define SET_KIND_OF_bmi270 SET_KIND_OF_icm42688
#define SET_KIND_OF_bmi088 SET_KIND_OF_icm42688
#define SET_KIND_OF_lsm6dsv SET_KIND_OF_icm42688

FAMILY(lsm6dso);
FAMILY(mpu6050);
FAMILY(icm42688);
FAMILY(icm20948);
FAMILY(bmi270);
FAMILY(bmi088);
FAMILY(lsm6dsv);

static const emul_spi_t of_st = {10000000, 1, {0, 0}, {false, false}}, of_mpu = {1000000, 1, {0, 0}, {false, false}},
                        of_42688 = {24000000, 1, {0, 0}, {false, false}}, of_20948 = {7000000, 1, {0, 0}, {false, false}},
                        of_270 = {10000000, 1, {1, 0}, {true, false}}, of_088 = {10000000, 2, {0, 1}, {false, true}};

const emul_kind_t emul_kinds[] = {
    {"LSM6DSO", &lsm6dso, 0x6B, 0x6C, false, 0, &of_st},
    {"LSM6DSOX", &lsm6dso, 0x6B, 0x6C, false, 0, &of_st},
    {"LSM6DSO32", &lsm6dso, 0x6B, 0x6C, true, 0, &of_st},
    {"LSM6DSR", &lsm6dso, 0x6B, 0x6B, false, 0, &of_st},
    {"LSM6DS3TR-C", &lsm6dso, 0x6B, 0x6A, false, 0, &of_st},
    {"LSM6DS3", &lsm6dso, 0x6B, 0x69, false, 0, &of_st},
    {"MPU-6050", &mpu6050, 0x68, 0x68, false, 0, NULL},
    {"MPU-6500", &mpu6050, 0x68, 0x70, false, 0, &of_mpu},
    {"MPU-9250", &mpu6050, 0x68, 0x71, false, 0, &of_mpu},
    {"MPU-9255", &mpu6050, 0x68, 0x73, false, 0, &of_mpu},
    {"ICM-42688-P", &icm42688, 0x68, 0x47, false, 0, &of_42688},
    {"ICM-20948", &icm20948, 0x68, 0xEA, false, 0, &of_20948},
    {"BMI270", &bmi270, 0x68, 0x24, false, 0, &of_270},
    {"BMI088", &bmi088, 0x68, 0x0F, false, 0x18, &of_088},
    {"LSM6DSV", &lsm6dsv, 0x6B, 0x70, false, 0, &of_st},
    {NULL, NULL, 0, 0, false, 0, NULL},
};

const emul_kind_t *emul_kind(const char *name) {
    const emul_kind_t *kind = emul_kinds;
    while (kind->name != NULL && strcmp(kind->name, name) != 0) {
        kind++;
    }
    return kind->name != NULL ? kind : NULL;
}

void emul_power_on(emul_t *emul, double clock, uint64_t now_us, double world_full_scale_dps) {
    const emul_kind_t *kind = emul->kind;
    emul->speaks_spi[0] = emul->speaks_spi[1] = false;
    kind->family->power_on(&emul->chip, kind->id, kind->is_32, clock, now_us, world_full_scale_dps);
}

void emul_brown_out(emul_t *emul) {
    emul->speaks_spi[0] = emul->speaks_spi[1] = false;
    emul->kind->family->brown_out(&emul->chip);
}

void emul_set_faults(emul_t *emul, const emul_faults_t *faults) {
    emul->kind->family->set_faults(&emul->chip, faults);
}

void emul_set_fed_only(emul_t *emul, bool fed_only) {
    emul->kind->family->set_fed_only(&emul->chip, fed_only);
}

void emul_set_world(emul_t *emul, const int16_t world[EMUL_WORDS]) {
    emul->kind->family->set_world(&emul->chip, world);
}

void emul_feed(emul_t *emul, uint64_t now_us, const int16_t world[EMUL_WORDS]) {
    emul->kind->family->feed(&emul->chip, now_us, world);
}

bool emul_batches(const emul_t *emul) {
    return emul->kind->family->batches(&emul->chip);
}

bool emul_int1(const emul_t *emul) {
    return emul->kind->family->int1(&emul->chip);
}

double emul_tick_us(const emul_t *emul) {
    return emul->kind->family->tick_us(&emul->chip);
}

void emul_advance(emul_t *emul, uint64_t now_us) {
    emul->kind->family->advance(&emul->chip, now_us);
}

/* The die that has the address: 0, 1, or -1. The dies' address pins have the same level. */
static int die_at(const emul_t *emul, uint8_t address) {
    const emul_kind_t *kind = emul->kind;
    const uint8_t first = emul->address != 0 ? emul->address : kind->address;
    const uint8_t second = (uint8_t)(kind->other_address + (first != kind->address ? 1 : 0));
    return address == first ? 0 : kind->other_address != 0 && address == second ? 1 : -1;
}

bool emul_is_at(const emul_t *emul, uint8_t address) {
    return die_at(emul, address) >= 0;
}

bool emul_i2c_off(const emul_t *emul) {
    return emul->kind->family->i2c_off(&emul->chip);
}

int emul_write_die(emul_t *emul, uint64_t now_us, unsigned die, uint8_t reg, const uint8_t *data, size_t n) {
    return emul->kind->family->write(&emul->chip, now_us, (uint8_t)(reg | die << 7), data, n);
}

int emul_read_die(emul_t *emul, uint64_t now_us, unsigned die, uint8_t reg, uint8_t *data, size_t n) {
    return emul->kind->family->read(&emul->chip, now_us, (uint8_t)(reg | die << 7), data, n);
}

int emul_write(emul_t *emul, uint64_t now_us, uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
    const int die = die_at(emul, address);
    return die < 0 || emul_i2c_off(emul) ? -1 : emul_write_die(emul, now_us, (unsigned)die, reg, data, n);
}

int emul_read(emul_t *emul, uint64_t now_us, uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
    const int die = die_at(emul, address);
    return die < 0 || emul_i2c_off(emul) ? -1 : emul_read_die(emul, now_us, (unsigned)die, reg, data, n);
}

const uint8_t *emul_part_file(const char *part, size_t *n) {
    return strcmp(part, "BMI270") == 0 ? emul_bmi270_file(n) : NULL;
}

int emul_low_pass(const emul_t *emul) {
    return emul->kind->family->low_pass(&emul->chip);
}

double emul_clock_for(const emul_t *emul, double rate_hz) {
    return emul->kind->family->clock_for(rate_hz);
}
