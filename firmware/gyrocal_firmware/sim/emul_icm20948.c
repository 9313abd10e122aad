#include "emul_icm20948.h"

#include <string.h>

enum {
    WHO_AM_I = 0x00, /* bank 0 */
    USER_CTRL = 0x03,
    PWR_MGMT_1 = 0x06,
    PWR_MGMT_2 = 0x07,
    INT_PIN_CFG = 0x0F,
    INT_ENABLE_1 = 0x11,
    INT_STATUS_1 = 0x1A,
    OUT_FIRST = 0x2D,
    OUT_LAST = 0x3A,
    SELF_TEST_X_GYRO = 0x02, /* bank 1 */
    GYRO_SMPLRT_DIV = 0x00, /* bank 2 */
    GYRO_CONFIG_1 = 0x01,
    GYRO_CONFIG_2 = 0x02,
    ACCEL_CONFIG = 0x14,
    BANK_SEL = 0x7F,
};

#define ID 0xEA
#define RESET 0x80u
#define SLEEP 0x40u
#define BOOT_US 11000u
#define RESET_US 2000u
#define GYRO_US 35000u
#define TEST_US 20000u
#define TEST_SHARE 1.05 /* of what it was at the factory */

static const uint8_t codes[3] = {150, 145, 155};

static void defaults(emul_icm20948_t *chip) {
    memset(chip->reg, 0, sizeof chip->reg);
    memset(chip->inside, 0, sizeof chip->inside);
    chip->bank = 0;
    chip->reg[0][WHO_AM_I] = ID;
    chip->reg[0][PWR_MGMT_1] = 0x41;
    memcpy(chip->reg[1] + SELF_TEST_X_GYRO, codes, sizeof codes);
    chip->reg[2][GYRO_CONFIG_1] = 0x01;
    chip->reg[2][ACCEL_CONFIG] = 0x01;
    chip->gyro_us = UINT64_MAX;
}

double emul_icm20948_clock_for(double rate_hz) {
    (void)rate_hz; /* its nominal rates are exact */
    return 1.0;
}

void emul_icm20948_power_on(emul_icm20948_t *chip, uint64_t now_us, double world_full_scale_dps) {
    const double clock = chip->clock;
    memset(chip, 0, sizeof *chip);
    chip->clock = clock > 0.0 ? clock : 1.0;
    chip->world_full_scale_dps = world_full_scale_dps;
    chip->boot_us = now_us + BOOT_US;
    defaults(chip);
}

void emul_icm20948_brown_out(emul_icm20948_t *chip) {
    defaults(chip);
}

static bool sleeps(const emul_icm20948_t *chip) {
    return (chip->reg[0][PWR_MGMT_1] & (RESET | SLEEP)) != 0;
}

/* The divider works with the filter only. */
static double period_us(const emul_icm20948_t *chip) {
    const bool filtered = (chip->reg[2][GYRO_CONFIG_1] & 1u) != 0;
    const double hz = filtered ? 1125.0 / (1.0 + chip->reg[2][GYRO_SMPLRT_DIV]) : 9000.0;
    return sleeps(chip) ? 0.0 : 1e6 / (hz * chip->clock);
}

/* ---- samples ---- */

/* Promised at 250 dps alone. */
static double moved_dps(const emul_icm20948_t *chip, uint64_t now_us, int axis) {
    const bool asked = (chip->reg[2][GYRO_CONFIG_2] & 0x20u >> axis) != 0 && (chip->reg[2][GYRO_CONFIG_1] & 6u) == 0;
    return asked && now_us >= chip->moved_us && !emul_is_stuck(chip->stuck_axes, axis) ? TEST_SHARE * emul_dps_of_code(codes[axis]) : 0.0;
}

static int16_t rate(const emul_icm20948_t *chip, uint64_t now_us, int axis) {
    static const double counts_a_dps[4] = {131.0, 65.5, 32.8, 16.4};
    const double dps = chip->world[1 + axis] * chip->world_full_scale_dps * EMUL_WORLD_DPS_OF_SCALE + moved_dps(chip, now_us, axis);
    const int16_t value = now_us < chip->gyro_us ? 0 : emul_counts(dps * counts_a_dps[chip->reg[2][GYRO_CONFIG_1] >> 1 & 3]);
    return (int16_t)(chip->stuck_bit ? value | 4 : value);
}

static void sample(emul_icm20948_t *chip, uint64_t now_us) {
    const double counts_a_g = 16384.0 / (double)(1u << (chip->reg[2][ACCEL_CONFIG] >> 1 & 3));
    const uint8_t off = chip->reg[0][PWR_MGMT_2];
    if (chip->stale || sleeps(chip)) {
        return;
    }
    chip->inside[0] = emul_counts((EMUL_WORLD_ZERO_C + chip->world[0] * EMUL_WORLD_C - 21.0) * 333.87);
    for (int i = 0; i < 3; i++) {
        chip->inside[1 + i] = (off & 7u) != 0 ? 0 : rate(chip, now_us, i);
        chip->inside[4 + i] = (off & 0x38u) != 0 ? 0 : emul_counts(chip->world[4 + i] * EMUL_WORLD_G * counts_a_g);
    }
    chip->reg[0][INT_STATUS_1] = (uint8_t)(chip->reg[0][INT_STATUS_1] | (chip->reg[0][INT_ENABLE_1] & 1u));
}

/* GYRO_DLPFCFG and one. */
int emul_icm20948_low_pass(const emul_icm20948_t *chip) {
    return (chip->reg[2][GYRO_CONFIG_1] & 1u) != 0 ? (chip->reg[2][GYRO_CONFIG_1] >> 3 & 7) + 1 : -1;
}

void emul_icm20948_advance(emul_icm20948_t *chip, uint64_t now_us) {
    if ((chip->reg[0][PWR_MGMT_1] & RESET) != 0 && now_us >= chip->reset_us) {
        defaults(chip);
    }
    const double period = period_us(chip);
    while (period > 0.0 && (double)now_us >= chip->tick_us && !chip->fed_only) {
        sample(chip, (uint64_t)chip->tick_us);
        chip->tick_us += period;
    }
}

void emul_icm20948_feed(emul_icm20948_t *chip, uint64_t now_us, const int16_t world[EMUL_WORDS]) {
    memcpy(chip->world, world, sizeof chip->world);
    chip->tick_us = (double)now_us + period_us(chip);
    sample(chip, now_us);
}

bool emul_icm20948_batches(const emul_icm20948_t *chip) {
    (void)chip;
    return false;
}

/* Without the latch the pin shows pulses of 50 us, which nobody who looks sees. */
bool emul_icm20948_int1(const emul_icm20948_t *chip) {
    return (chip->reg[0][INT_PIN_CFG] & 0x20u) != 0 && (chip->reg[0][INT_STATUS_1] & 1u) != 0;
}

/* ---- registers ---- */

/* Bits that a register of the bank in use keeps; the others read 0. */
static uint8_t kept_bits(uint8_t bank, uint8_t reg) {
    static const struct {
        uint8_t bank, reg, bits;
    } known[] = {{0, USER_CTRL, 0xFE}, {0, 0x05, 0x70}, {0, PWR_MGMT_1, 0xEF},      {0, PWR_MGMT_2, 0x3F},    {0, INT_PIN_CFG, 0xFE},
                 {0, 0x10, 0x8F}, {0, INT_ENABLE_1, 0x01}, {2, GYRO_SMPLRT_DIV, 0xFF}, {2, GYRO_CONFIG_1, 0x3F}, {2, GYRO_CONFIG_2, 0x3F},
                 {2, 0x10, 0x0F}, {2, 0x11, 0xFF},         {2, ACCEL_CONFIG, 0x3F},    {2, 0x15, 0x1F}};
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        if (known[i].bank == bank && known[i].reg == reg) {
            return known[i].bits;
        }
    }
    return 0;
}

static void write_power(emul_icm20948_t *chip, uint64_t now_us, uint8_t value) {
    const bool slept = sleeps(chip);
    if ((value & RESET) != 0) {
        chip->reg[0][PWR_MGMT_1] |= RESET;
        chip->reset_us = chip->stuck_reset ? UINT64_MAX : now_us + RESET_US;
        return;
    }
    chip->reg[0][PWR_MGMT_1] = (uint8_t)(value & kept_bits(0, PWR_MGMT_1));
    if (sleeps(chip)) {
        chip->gyro_us = UINT64_MAX;
    } else if (slept) {
        chip->gyro_us = now_us + GYRO_US;
        chip->tick_us = (double)now_us + period_us(chip);
    }
}

static void write_one(emul_icm20948_t *chip, uint64_t now_us, uint8_t reg, uint8_t value) {
    if ((chip->reg[0][PWR_MGMT_1] & RESET) != 0) {
        return;
    }
    if (reg == BANK_SEL) {
        chip->bank = value >> 4 & 3u;
    } else if (chip->bank == 0 && reg == PWR_MGMT_1) {
        write_power(chip, now_us, value);
    } else if (!sleeps(chip) && kept_bits(chip->bank, reg) != 0) {
        chip->reg[chip->bank][reg] = (uint8_t)(value & kept_bits(chip->bank, reg));
        chip->moved_us = chip->bank == 2 && reg == GYRO_CONFIG_2 ? now_us + TEST_US : chip->moved_us;
        if (chip->bank == 2 && (reg == GYRO_SMPLRT_DIV || reg == GYRO_CONFIG_1)) {
            chip->tick_us = (double)now_us + period_us(chip);
        }
    }
}

static uint8_t read_one(emul_icm20948_t *chip, uint8_t reg, const int16_t shown[EMUL_WORDS]) {
    static const uint8_t order[EMUL_WORDS] = {4, 5, 6, 1, 2, 3, 0}; /* accelerometer, gyroscope, temperature */
    if (reg == BANK_SEL) {
        return (uint8_t)(chip->bank << 4);
    }
    if (chip->bank == 0 && reg == WHO_AM_I && chip->wrong_id) {
        return 0x55;
    }
    if (chip->bank == 0 && reg >= OUT_FIRST && reg <= OUT_LAST) {
        const uint16_t word = (uint16_t)shown[order[(reg - OUT_FIRST) / 2]];
        return (uint8_t)((reg - OUT_FIRST) % 2 == 0 ? word >> 8 : word & 0xFF);
    }
    if (chip->no_code && chip->bank == 1) {
        return 0;
    }
    const uint8_t value = chip->reg[chip->bank][reg];
    if (chip->bank == 0 && reg == INT_STATUS_1) {
        chip->reg[0][reg] = 0;
    }
    return value;
}

bool emul_icm20948_i2c_off(const emul_icm20948_t *chip) {
    return (chip->reg[0][USER_CTRL] & 0x10u) != 0;
}

static bool silent(const emul_icm20948_t *chip, uint64_t now_us) {
    return chip->nack || now_us < chip->boot_us;
}

int emul_icm20948_write(emul_icm20948_t *chip, uint64_t now_us, uint8_t reg, const uint8_t *data, size_t n) {
    if (silent(chip, now_us)) {
        return -1;
    }
    emul_icm20948_advance(chip, now_us);
    for (size_t i = 0; i < n; i++) {
        write_one(chip, now_us, (uint8_t)((reg + i) & 0x7F), data[i]);
    }
    return (int)n;
}

int emul_icm20948_read(emul_icm20948_t *chip, uint64_t now_us, uint8_t reg, uint8_t *data, size_t n) {
    int16_t shown[EMUL_WORDS];
    if (silent(chip, now_us)) {
        return -1;
    }
    emul_icm20948_advance(chip, now_us);
    memcpy(shown, chip->inside, sizeof shown);
    for (size_t i = 0; i < n; i++) {
        data[i] = read_one(chip, (uint8_t)((reg + i) & 0x7F), shown);
    }
    return (int)n;
}
