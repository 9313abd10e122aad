#include "emul_lsm6dso.h"

#include <math.h>
#include <string.h>

enum {
    INT1_CTRL = 0x0D,
    WHO_AM_I = 0x0F,
    CTRL1_XL = 0x10,
    CTRL2_G = 0x11,
    CTRL3_C = 0x12,
    CTRL10_C = 0x19,
    STATUS_REG = 0x1E,
    OUT_FIRST = 0x20,
    OUT_LAST = 0x2D,
};

#define BOOT_US 10000u
#define RESET_US 50u
#define SETTLE_US 70000u

static const double odr_hz[] = {0, 12.5, 26, 52, 104, 208, 416, 833, 1666, 3332, 6664, 0, 0, 0, 0, 0};

static void defaults(emul_lsm6dso_t *chip) {
    memset(chip->reg, 0, sizeof chip->reg);
    chip->reg[WHO_AM_I] = 0x6C;
    chip->reg[CTRL3_C] = 0x04;
    chip->reg[0x18] = 0xE0; /* CTRL9_XL */
    memset(chip->out, 0, sizeof chip->out);
    memset(chip->half_read, 0, sizeof chip->half_read);
    memset(chip->waiting, 0, sizeof chip->waiting);
}

void emul_lsm6dso_power_on(emul_lsm6dso_t *chip, uint64_t now_us, double world_full_scale_dps) {
    memset(chip, 0, sizeof *chip);
    defaults(chip);
    chip->world_full_scale_dps = world_full_scale_dps;
    chip->boot_us = now_us + BOOT_US;
}

void emul_lsm6dso_brown_out(emul_lsm6dso_t *chip) {
    defaults(chip);
}

static double full_scale_dps(const emul_lsm6dso_t *chip) {
    static const double of_bits[] = {250, 500, 1000, 2000};
    return chip->reg[CTRL2_G] & 0x02 ? 125.0 : of_bits[chip->reg[CTRL2_G] >> 2 & 3];
}

static double full_scale_g(const emul_lsm6dso_t *chip) {
    static const double of_bits[] = {2, 16, 4, 8};
    return of_bits[chip->reg[CTRL1_XL] >> 2 & 3];
}

static int16_t to_counts(int16_t world, double gain) {
    const double x = rint(world * gain);
    return (int16_t)(x > 32767.0 ? 32767.0 : x < -32768.0 ? -32768.0 : x);
}

static void sample(emul_lsm6dso_t *chip, uint64_t now_us) {
    const bool gyro = chip->reg[CTRL2_G] >> 4 != 0;
    const bool acc = chip->reg[CTRL1_XL] >> 4 != 0;
    if (chip->stale) {
        return;
    }
    for (int i = 0; i < EMUL_WORDS; i++) {
        int16_t value = chip->world[i];
        if ((i == 0 && !gyro && !acc) || (i >= 1 && i <= 3 && !gyro) || (i >= 4 && !acc)) {
            continue;
        }
        if (i >= 1 && i <= 3) {
            value = now_us < chip->settled_us ? 0 : to_counts(value, chip->world_full_scale_dps / full_scale_dps(chip));
            value = (int16_t)(chip->stuck_bit ? value | 4 : value);
        } else if (i >= 4) {
            value = to_counts(value, 2.0 / full_scale_g(chip));
        }
        if (chip->half_read[i] && (chip->reg[CTRL3_C] & 0x40)) {
            chip->next[i] = value;
            chip->waiting[i] = true;
        } else {
            chip->out[i] = value;
        }
    }
    chip->reg[STATUS_REG] = (uint8_t)(chip->reg[STATUS_REG] | (gyro ? 2 : 0) | (acc ? 1 : 0) | (gyro || acc ? 4 : 0));
}

static double period_us(const emul_lsm6dso_t *chip) {
    const double gyro = odr_hz[chip->reg[CTRL2_G] >> 4];
    const double acc = odr_hz[chip->reg[CTRL1_XL] >> 4];
    const double rate = gyro > 0 ? gyro : acc;
    return rate > 0 ? 1e6 / rate : 0.0;
}

void emul_lsm6dso_advance(emul_lsm6dso_t *chip, uint64_t now_us) {
    const double period = period_us(chip);
    const double now = (double)now_us;
    if (period > 0.0 && now >= chip->tick_us) {
        chip->tick_us += period * (1.0 + floor((now - chip->tick_us) / period));
        sample(chip, now_us);
    }
}

void emul_lsm6dso_feed(emul_lsm6dso_t *chip, uint64_t now_us, const int16_t world[EMUL_WORDS]) {
    memcpy(chip->world, world, sizeof chip->world);
    chip->tick_us = (double)now_us + period_us(chip);
    sample(chip, now_us);
}

static void write_one(emul_lsm6dso_t *chip, uint64_t now_us, uint8_t reg, uint8_t value) {
    const bool gyro_was_off = chip->reg[CTRL2_G] >> 4 == 0;
    if ((reg < CTRL1_XL && reg != INT1_CTRL) || (reg > CTRL10_C && reg <= OUT_LAST)) {
        return; /* read-only or reserved */
    }
    if (reg == CTRL3_C && (value & 1)) {
        defaults(chip);
        chip->reset_us = chip->stuck_reset ? UINT64_MAX : now_us + RESET_US;
        return;
    }
    chip->reg[reg] = value;
    if (reg == CTRL2_G && gyro_was_off && value >> 4 != 0) {
        chip->settled_us = now_us + SETTLE_US;
    }
    if (reg == CTRL1_XL || reg == CTRL2_G) {
        chip->tick_us = (double)now_us + period_us(chip);
    }
}

static uint8_t read_one(emul_lsm6dso_t *chip, uint64_t now_us, uint8_t reg) {
    if (reg == WHO_AM_I && chip->wrong_id) {
        return 0x6B;
    }
    if (reg == CTRL3_C) {
        return (uint8_t)(chip->reg[reg] | (now_us < chip->reset_us ? 1 : 0));
    }
    if (reg < OUT_FIRST || reg > OUT_LAST) {
        return chip->reg[reg];
    }
    const int i = (reg - OUT_FIRST) / 2;
    const uint16_t word = (uint16_t)chip->out[i];
    if ((reg & 1) == 0) {
        chip->half_read[i] = true;
        return (uint8_t)(word & 0xFF);
    }
    chip->half_read[i] = false;
    chip->reg[STATUS_REG] = (uint8_t)(chip->reg[STATUS_REG] & ~(i == 0 ? 4 : i <= 3 ? 2 : 1));
    if (chip->waiting[i]) {
        chip->waiting[i] = false;
        chip->out[i] = chip->next[i];
        chip->reg[STATUS_REG] = (uint8_t)(chip->reg[STATUS_REG] | (i == 0 ? 4 : i <= 3 ? 2 : 1));
    }
    return (uint8_t)(word >> 8);
}

static bool silent(const emul_lsm6dso_t *chip, uint64_t now_us) {
    return chip->nack || now_us < chip->boot_us;
}

static uint8_t following(const emul_lsm6dso_t *chip, uint8_t reg) {
    return (uint8_t)((chip->reg[CTRL3_C] & 0x04 ? reg + 1 : reg) & 0x7F); /* IF_INC */
}

int emul_lsm6dso_write(emul_lsm6dso_t *chip, uint64_t now_us, uint8_t reg, const uint8_t *data, size_t n) {
    if (silent(chip, now_us)) {
        return -1;
    }
    emul_lsm6dso_advance(chip, now_us);
    for (size_t i = 0; i < n; i++, reg = following(chip, reg)) {
        write_one(chip, now_us, reg & 0x7F, data[i]);
    }
    return (int)n;
}

int emul_lsm6dso_read(emul_lsm6dso_t *chip, uint64_t now_us, uint8_t reg, uint8_t *data, size_t n) {
    if (silent(chip, now_us)) {
        return -1;
    }
    emul_lsm6dso_advance(chip, now_us);
    for (size_t i = 0; i < n; i++, reg = following(chip, reg)) {
        data[i] = read_one(chip, now_us, reg & 0x7F);
    }
    return (int)n;
}
