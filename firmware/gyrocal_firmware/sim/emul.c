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
        SET_TAGS_OF_##part(c, faults);                                                                                   \
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
    static const emul_family_t part = {part##_power_on, part##_brown_out, part##_set_faults, part##_set_fed_only,        \
                                       part##_set_world, part##_feed, part##_batches, part##_int1, part##_tick_us,       \
                                       part##_advance, part##_write, part##_read, emul_##part##_clock_for}

#define SET_TAGS_OF_lsm6dso(c, faults) (c)->bad_tags = (faults)->bad_tags
#define SET_TAGS_OF_mpu6050(c, faults) (void)(faults)->bad_tags
#define SET_TAGS_OF_icm42688(c, faults) (void)(faults)->bad_tags
#define SET_KIND_OF_lsm6dso(c, the_id, the_32) ((c)->id = (the_id), (c)->is_32 = (the_32))
#define SET_KIND_OF_mpu6050(c, the_id, the_32) ((c)->id = (the_id), (void)(the_32))
#define SET_KIND_OF_icm42688(c, the_id, the_32) ((void)(the_id), (void)(the_32))

FAMILY(lsm6dso);
FAMILY(mpu6050);
FAMILY(icm42688);

const emul_kind_t emul_kinds[] = {
    {"LSM6DSO", &lsm6dso, 0x6B, 0x6C, false},     {"LSM6DSOX", &lsm6dso, 0x6B, 0x6C, false},
    {"LSM6DSO32", &lsm6dso, 0x6B, 0x6C, true},    {"LSM6DSR", &lsm6dso, 0x6B, 0x6B, false},
    {"LSM6DS3TR-C", &lsm6dso, 0x6B, 0x6A, false}, {"LSM6DS3", &lsm6dso, 0x6B, 0x69, false},
    {"MPU-6050", &mpu6050, 0x68, 0x68, false},    {"MPU-6500", &mpu6050, 0x68, 0x70, false},
    {"MPU-9250", &mpu6050, 0x68, 0x71, false},    {"MPU-9255", &mpu6050, 0x68, 0x73, false},
    {"ICM-42688-P", &icm42688, 0x68, 0x47, false}, {NULL, NULL, 0, 0, false},
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
    kind->family->power_on(&emul->chip, kind->id, kind->is_32, clock, now_us, world_full_scale_dps);
}

void emul_brown_out(emul_t *emul) {
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

int emul_write(emul_t *emul, uint64_t now_us, uint8_t reg, const uint8_t *data, size_t n) {
    return emul->kind->family->write(&emul->chip, now_us, reg, data, n);
}

int emul_read(emul_t *emul, uint64_t now_us, uint8_t reg, uint8_t *data, size_t n) {
    return emul->kind->family->read(&emul->chip, now_us, reg, data, n);
}

double emul_clock_for(const emul_t *emul, double rate_hz) {
    return emul->kind->family->clock_for(rate_hz);
}
