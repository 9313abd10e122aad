#include "emul_icm42688.h"

#include <string.h>

enum {
    DEVICE_CONFIG = 0x11,
    INT_CONFIG = 0x14,
    OUT_FIRST = 0x1D,
    OUT_LAST = 0x2A,
    INT_STATUS = 0x2D,
    INTF_CONFIG0 = 0x4C,
    PWR_MGMT0 = 0x4E,
    GYRO_CONFIG0 = 0x4F,
    ACCEL_CONFIG0 = 0x50,
    GYRO_CONFIG1 = 0x51,
    GYRO_ACCEL_CONFIG0 = 0x52,
    INT_CONFIG1 = 0x64,
    INT_SOURCE0 = 0x65,
    SELF_TEST_CONFIG = 0x70,
    WHO_AM_I = 0x75,
    REG_BANK_SEL = 0x76,
    XG_ST_DATA = 0x5F, /* of bank 1 */
};

#define DATA_RDY 0x08u
#define RESET_DONE 0x10u
#define BOOT_US 3000u
#define RESET_US 900u
#define DEAF_US 200u
#define GYRO_US 30000u
#define TEST_US 190000u
#define TEST_SHARE 1.05 /* of what it was at the factory */

static const uint8_t codes[3] = {150, 145, 155};

/* Output rates by code, Hz; 0 = reserved, or too fast for a bus such as this. */
static const double odr_hz[16] = {0, 0, 0, 8000, 4000, 2000, 1000, 200, 100, 50, 25, 12.5, 0, 0, 0, 500};

static void defaults(emul_icm42688_t *chip) {
    memset(chip->reg, 0, sizeof chip->reg);
    memset(chip->inside, 0, sizeof chip->inside);
    chip->bank = 0;
    chip->reg[WHO_AM_I] = 0x47;
    chip->reg[INTF_CONFIG0] = 0x30; /* the high byte comes first */
    chip->reg[GYRO_CONFIG0] = 0x06;
    chip->reg[ACCEL_CONFIG0] = 0x06;
    chip->reg[GYRO_CONFIG1] = 0x16;
    chip->reg[GYRO_ACCEL_CONFIG0] = 0x11;
    chip->reg[INT_CONFIG1] = 0x10;
    chip->reg[INT_SOURCE0] = 0x10;
    chip->gyro_us = UINT64_MAX;
}

double emul_icm42688_clock_for(double rate_hz) {
    (void)rate_hz; /* its nominal rates are exact */
    return 1.0;
}

void emul_icm42688_power_on(emul_icm42688_t *chip, uint64_t now_us, double world_full_scale_dps) {
    const double clock = chip->clock;
    memset(chip, 0, sizeof *chip);
    chip->clock = clock > 0.0 ? clock : 1.0;
    chip->world_full_scale_dps = world_full_scale_dps;
    chip->boot_us = now_us + BOOT_US;
    defaults(chip);
    chip->reg[INT_STATUS] = RESET_DONE;
}

void emul_icm42688_brown_out(emul_icm42688_t *chip) {
    defaults(chip);
}

static bool gyro_on(const emul_icm42688_t *chip) {
    return (chip->reg[PWR_MGMT0] >> 2 & 3) == 3;
}

static bool acc_on(const emul_icm42688_t *chip) {
    return (chip->reg[PWR_MGMT0] & 3) >= 2;
}

static double period_us(const emul_icm42688_t *chip) {
    const double hz = gyro_on(chip) ? odr_hz[chip->reg[GYRO_CONFIG0] & 15] : acc_on(chip) ? odr_hz[chip->reg[ACCEL_CONFIG0] & 15] : 0.0;
    return hz > 0.0 ? 1e6 / (hz * chip->clock) : 0.0;
}

/* ---- samples ---- */

/* Promised at 250 dps alone. */
static double moved_dps(const emul_icm42688_t *chip, uint64_t now_us, int axis) {
    const bool asked = (chip->reg[SELF_TEST_CONFIG] >> axis & 1) != 0 && chip->reg[GYRO_CONFIG0] >> 5 == 3;
    return asked && now_us >= chip->moved_us && !emul_is_stuck(chip->stuck_axes, axis) ? TEST_SHARE * emul_dps_of_code(codes[axis]) : 0.0;
}

static int16_t rate(const emul_icm42688_t *chip, uint64_t now_us, int axis) {
    static const double counts_a_dps[8] = {16.4, 32.8, 65.5, 131.0, 262.0, 524.3, 1048.6, 2097.2};
    const double dps = chip->world[1 + axis] * chip->world_full_scale_dps * EMUL_WORLD_DPS_OF_SCALE + moved_dps(chip, now_us, axis);
    const int16_t value = now_us < chip->gyro_us ? 0 : emul_counts(dps * counts_a_dps[chip->reg[GYRO_CONFIG0] >> 5]);
    return (int16_t)(chip->stuck_bit ? value | 4 : value);
}

static void sample(emul_icm42688_t *chip, uint64_t now_us) {
    const double counts_a_g = (double)(2048u << (chip->reg[ACCEL_CONFIG0] >> 5 & 3));
    if (chip->stale || period_us(chip) == 0.0) {
        return;
    }
    chip->inside[0] = emul_counts((EMUL_WORLD_ZERO_C + chip->world[0] * EMUL_WORLD_C - 25.0) * 132.48);
    for (int i = 0; i < 3; i++) {
        chip->inside[1 + i] = gyro_on(chip) ? rate(chip, now_us, i) : INT16_MIN;
        chip->inside[4 + i] = acc_on(chip) ? emul_counts(chip->world[4 + i] * EMUL_WORLD_G * counts_a_g) : INT16_MIN;
    }
    chip->reg[INT_STATUS] |= DATA_RDY;
}

static void finish_reset(emul_icm42688_t *chip, uint64_t now_us) {
    if (chip->reset_us != 0 && now_us >= chip->reset_us) {
        chip->reset_us = 0;
        defaults(chip);
        chip->reg[INT_STATUS] = RESET_DONE;
    }
}

/* GYRO_UI_FILT_BW and one; 8 to 13 are reserved, and the two behind them are no filters of this kind. */
int emul_icm42688_low_pass(const emul_icm42688_t *chip) {
    const int filter = chip->reg[GYRO_ACCEL_CONFIG0] & 15u;
    return filter < 8 ? filter + 1 : -1;
}

void emul_icm42688_advance(emul_icm42688_t *chip, uint64_t now_us) {
    finish_reset(chip, now_us);
    const double period = period_us(chip);
    while (period > 0.0 && (double)now_us >= chip->tick_us && !chip->fed_only) {
        sample(chip, (uint64_t)chip->tick_us);
        chip->tick_us += period;
    }
}

void emul_icm42688_feed(emul_icm42688_t *chip, uint64_t now_us, const int16_t world[EMUL_WORDS]) {
    memcpy(chip->world, world, sizeof chip->world);
    chip->tick_us = (double)now_us + period_us(chip);
    sample(chip, now_us);
}

bool emul_icm42688_batches(const emul_icm42688_t *chip) {
    (void)chip;
    return false;
}

/* Latched, push-pull and active high are chosen by three bits; otherwise the pin shows pulses, which nobody who looks sees. */
bool emul_icm42688_int1(const emul_icm42688_t *chip) {
    const bool works = (chip->reg[INT_CONFIG1] & 0x10u) == 0 && (chip->reg[INT_CONFIG] & 7u) == 7u;
    return works && (chip->reg[INT_STATUS] & chip->reg[INT_SOURCE0] & DATA_RDY) != 0;
}

/* ---- registers ---- */

static bool writable(uint8_t reg) {
    return reg == DEVICE_CONFIG || reg == 0x13 || reg == INT_CONFIG || reg == 0x16 || (reg >= 0x4B && reg <= 0x57) ||
           (reg >= 0x5F && reg <= 0x69) || reg == SELF_TEST_CONFIG;
}

static void write_one(emul_icm42688_t *chip, uint64_t now_us, uint8_t reg, uint8_t value) {
    if (chip->reset_us != 0 || now_us < chip->deaf_us) {
        return;
    }
    if (reg == REG_BANK_SEL) {
        chip->bank = value & 7u;
        return;
    }
    if (chip->bank != 0 || !writable(reg)) {
        return;
    }
    if (reg == DEVICE_CONFIG && (value & 1u) != 0) {
        chip->reset_us = chip->stuck_reset ? UINT64_MAX : now_us + RESET_US;
        chip->reg[INT_STATUS] = 0;
        return;
    }
    const bool gyro_was_on = gyro_on(chip);
    chip->reg[reg] = reg == PWR_MGMT0 ? value & 0x3Fu : reg == GYRO_CONFIG0 || reg == ACCEL_CONFIG0 ? value & 0xEFu : value;
    chip->moved_us = reg == SELF_TEST_CONFIG ? now_us + TEST_US : chip->moved_us;
    if (reg == PWR_MGMT0) {
        chip->deaf_us = now_us + DEAF_US;
        chip->gyro_us = !gyro_on(chip) ? UINT64_MAX : gyro_was_on ? chip->gyro_us : now_us + GYRO_US;
    }
    if (reg == PWR_MGMT0 || reg == GYRO_CONFIG0) {
        chip->tick_us = (double)now_us + period_us(chip);
    }
}

static uint8_t read_one(emul_icm42688_t *chip, uint8_t reg, const int16_t shown[EMUL_WORDS]) {
    static const uint8_t order[EMUL_WORDS] = {0, 4, 5, 6, 1, 2, 3}; /* temperature, accelerometer, gyroscope */
    if (reg == REG_BANK_SEL) {
        return chip->bank;
    }
    if (chip->bank == 1 && reg >= XG_ST_DATA && reg < XG_ST_DATA + 3 && chip->reset_us == 0) {
        return chip->no_code ? 0 : codes[reg - XG_ST_DATA];
    }
    if (chip->bank != 0 || chip->reset_us != 0) {
        return 0;
    }
    if (reg == WHO_AM_I && chip->wrong_id) {
        return 0x55;
    }
    if (reg >= OUT_FIRST && reg <= OUT_LAST) {
        const uint16_t word = (uint16_t)shown[order[(reg - OUT_FIRST) / 2]];
        return (uint8_t)((reg - OUT_FIRST) % 2 == 0 ? word >> 8 : word & 0xFF);
    }
    const uint8_t value = chip->reg[reg];
    if (reg == INT_STATUS) {
        chip->reg[reg] = 0;
    }
    return value;
}

bool emul_icm42688_i2c_off(const emul_icm42688_t *chip) {
    return (chip->reg[INTF_CONFIG0] & 3u) == 3u;
}

static bool silent(const emul_icm42688_t *chip, uint64_t now_us) {
    return chip->nack || now_us < chip->boot_us;
}

int emul_icm42688_write(emul_icm42688_t *chip, uint64_t now_us, uint8_t reg, const uint8_t *data, size_t n) {
    if (silent(chip, now_us)) {
        return -1;
    }
    emul_icm42688_advance(chip, now_us);
    for (size_t i = 0; i < n; i++) {
        write_one(chip, now_us, (uint8_t)((reg + i) & 0x7F), data[i]);
    }
    return (int)n;
}

int emul_icm42688_read(emul_icm42688_t *chip, uint64_t now_us, uint8_t reg, uint8_t *data, size_t n) {
    int16_t shown[EMUL_WORDS];
    if (silent(chip, now_us)) {
        return -1;
    }
    emul_icm42688_advance(chip, now_us);
    memcpy(shown, chip->inside, sizeof shown);
    for (size_t i = 0; i < n; i++) {
        data[i] = read_one(chip, (uint8_t)((reg + i) & 0x7F), shown);
    }
    return (int)n;
}
