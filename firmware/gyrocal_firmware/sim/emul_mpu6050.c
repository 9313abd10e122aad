#include "emul_mpu6050.h"

#include <string.h>

enum {
    SELF_TEST_X_GYRO = 0x00, /* of the MPU-6500 and its successors */
    SELF_TEST_X = 0x0D,      /* of the MPU-6050 */
    SMPLRT_DIV = 0x19,
    CONFIG = 0x1A,
    GYRO_CONFIG = 0x1B,
    ACCEL_CONFIG = 0x1C,
    ACCEL_CONFIG_2 = 0x1D,
    INT_PIN_CFG = 0x37,
    INT_ENABLE = 0x38,
    INT_STATUS = 0x3A,
    OUT_FIRST = 0x3B,
    OUT_LAST = 0x48,
    USER_CTRL = 0x6A,
    PWR_MGMT_1 = 0x6B,
    PWR_MGMT_2 = 0x6C,
    WHO_AM_I = 0x75,
};

#define ID_6050 0x68
#define RESET 0x80u
#define SLEEP 0x40u
#define BOOT_US 90000u
#define RESET_US 2000u
#define GYRO_US 30000u
#define TEST_US 150000u
#define TEST_SHARE 1.05 /* of what it was at the factory */
#define OSCILLATOR 0.97 /* the internal one's rate over the gyroscope's; within its 5 % */

static const uint8_t codes[2][3] = {{150, 145, 155}, {12, 17, 9}};

static bool is_6050(const emul_mpu6050_t *chip) {
    return chip->id == ID_6050;
}

static void defaults(emul_mpu6050_t *chip) {
    memset(chip->reg, 0, sizeof chip->reg);
    memset(chip->inside, 0, sizeof chip->inside);
    chip->reg[WHO_AM_I] = chip->id;
    chip->reg[PWR_MGMT_1] = is_6050(chip) ? SLEEP : 0x01;
    memcpy(chip->reg + (is_6050(chip) ? SELF_TEST_X : SELF_TEST_X_GYRO), codes[is_6050(chip)], sizeof codes[0]);
    chip->by_gyro = false;
}

double emul_mpu6050_clock_for(double rate_hz) {
    (void)rate_hz; /* its nominal rates are exact */
    return 1.0;
}

void emul_mpu6050_power_on(emul_mpu6050_t *chip, uint64_t now_us, double world_full_scale_dps) {
    const double clock = chip->clock;
    const uint8_t id = chip->id;
    memset(chip, 0, sizeof *chip);
    chip->clock = clock > 0.0 ? clock : 1.0;
    chip->id = id != 0 ? id : ID_6050;
    chip->world_full_scale_dps = world_full_scale_dps;
    chip->boot_us = now_us + BOOT_US;
    chip->gyro_us = UINT64_MAX;
    defaults(chip);
}

void emul_mpu6050_brown_out(emul_mpu6050_t *chip) {
    chip->gyro_us = UINT64_MAX;
    defaults(chip);
}

static bool sleeps(const emul_mpu6050_t *chip) {
    return (chip->reg[PWR_MGMT_1] & (RESET | SLEEP)) != 0;
}

static double period_us(const emul_mpu6050_t *chip) {
    const unsigned filter = chip->reg[CONFIG] & 7u;
    const double base_hz = (filter == 0 || filter == 7 ? 8000.0 : 1000.0) * chip->clock * (chip->by_gyro ? 1.0 : OSCILLATOR);
    return sleeps(chip) ? 0.0 : 1e6 * (1.0 + chip->reg[SMPLRT_DIV]) / base_hz;
}

/* ---- samples ---- */

/* Promised at 250 dps alone. */
static double moved_dps(const emul_mpu6050_t *chip, uint64_t now_us, int axis) {
    const uint8_t code = codes[is_6050(chip)][axis];
    const double factory_dps = !is_6050(chip) ? emul_dps_of_code(code) : (axis == 1 ? -25.0 : 25.0) * pow(1.046, code - 1.0);
    const bool asked = (chip->reg[GYRO_CONFIG] & 0x80u >> axis) != 0 && (chip->reg[GYRO_CONFIG] & 0x18u) == 0;
    return asked && now_us >= chip->moved_us && !emul_is_stuck(chip->stuck_axes, axis) ? TEST_SHARE * factory_dps : 0.0;
}

static int16_t rate(const emul_mpu6050_t *chip, uint64_t now_us, int axis) {
    static const double counts_a_dps[4] = {131.0, 65.5, 32.8, 16.4};
    const double dps = chip->world[1 + axis] * chip->world_full_scale_dps * EMUL_WORLD_DPS_OF_SCALE + moved_dps(chip, now_us, axis);
    const int16_t value = now_us < chip->gyro_us ? 0 : emul_counts(dps * counts_a_dps[chip->reg[GYRO_CONFIG] >> 3 & 3]);
    return (int16_t)(chip->stuck_bit ? value | 4 : value);
}

static void sample(emul_mpu6050_t *chip, uint64_t now_us) {
    const double lsb_g = (double)(1u << (chip->reg[ACCEL_CONFIG] >> 3 & 3)) / 16384.0;
    const double temp_c = EMUL_WORLD_ZERO_C + chip->world[0] * EMUL_WORLD_C;
    if (chip->stale || sleeps(chip)) {
        return;
    }
    chip->inside[0] = is_6050(chip) ? emul_counts((temp_c - 36.53) * 340.0) : emul_counts((temp_c - 21.0) * 333.87);
    for (int i = 0; i < 3; i++) {
        const bool gyro_off = (chip->reg[PWR_MGMT_2] >> (2 - i) & 1) != 0;
        const bool acc_off = (chip->reg[PWR_MGMT_2] >> (5 - i) & 1) != 0;
        chip->inside[1 + i] = gyro_off ? 0 : rate(chip, now_us, i);
        chip->inside[4 + i] = acc_off ? 0 : emul_counts(chip->world[4 + i] * EMUL_WORLD_G / lsb_g);
    }
    chip->reg[INT_STATUS] = (uint8_t)(chip->reg[INT_STATUS] | (chip->reg[INT_ENABLE] & 1u));
}

/* DLPF_CFG; 0 and 7 raise the rate to 8 kHz. */
int emul_mpu6050_low_pass(const emul_mpu6050_t *chip) {
    const int filter = chip->reg[CONFIG] & 7u;
    return filter == 0 || filter == 7 ? -1 : filter;
}

void emul_mpu6050_advance(emul_mpu6050_t *chip, uint64_t now_us) {
    const double period = period_us(chip);
    if ((chip->reg[PWR_MGMT_1] & RESET) != 0 && now_us >= chip->reset_us) {
        defaults(chip);
    }
    while (period > 0.0 && (double)now_us >= chip->tick_us && !chip->fed_only) {
        sample(chip, (uint64_t)chip->tick_us);
        chip->tick_us += period;
    }
}

void emul_mpu6050_feed(emul_mpu6050_t *chip, uint64_t now_us, const int16_t world[EMUL_WORDS]) {
    memcpy(chip->world, world, sizeof chip->world);
    chip->tick_us = (double)now_us + period_us(chip);
    sample(chip, now_us);
}

bool emul_mpu6050_batches(const emul_mpu6050_t *chip) {
    (void)chip;
    return false;
}

/* Without the latch the pin shows pulses of 50 us, which nobody who looks sees. */
bool emul_mpu6050_int1(const emul_mpu6050_t *chip) {
    return (chip->reg[INT_PIN_CFG] & 0x20u) != 0 && (chip->reg[INT_STATUS] & chip->reg[INT_ENABLE]) != 0;
}

/* ---- registers ---- */

/* Bits that a register keeps; the others read 0. */
static uint8_t kept_bits(const emul_mpu6050_t *chip, uint8_t reg) {
    switch (reg) {
    case SMPLRT_DIV:
        return 0xFF;
    case CONFIG:
        return 0x3F;
    case GYRO_CONFIG:
    case ACCEL_CONFIG:
        return 0xF8;
    case ACCEL_CONFIG_2:
        return is_6050(chip) ? 0xFF : 0x0F;
    case INT_PIN_CFG:
        return 0xFE;
    case INT_ENABLE:
        return 0x19;
    case USER_CTRL:
        return 0x70;
    case PWR_MGMT_1:
        return 0xEF;
    case PWR_MGMT_2:
        return 0xFF;
    default:
        return reg >= 0x1E && reg <= 0x34 ? 0xFF : 0;
    }
}

static void write_power(emul_mpu6050_t *chip, uint64_t now_us, uint8_t value) {
    const bool slept = sleeps(chip);
    if ((value & RESET) != 0) {
        chip->reg[PWR_MGMT_1] |= RESET;
        chip->reset_us = chip->stuck_reset ? UINT64_MAX : now_us + RESET_US;
        chip->gyro_us = is_6050(chip) ? UINT64_MAX : now_us + RESET_US + GYRO_US;
        return;
    }
    chip->reg[PWR_MGMT_1] = (uint8_t)(value & kept_bits(chip, PWR_MGMT_1));
    if (sleeps(chip)) {
        chip->gyro_us = UINT64_MAX;
        return;
    }
    if (slept) {
        chip->gyro_us = now_us + GYRO_US;
        chip->tick_us = (double)now_us + period_us(chip);
    }
    chip->by_gyro = (value & 7u) >= 1 && (value & 7u) <= 3 && now_us >= chip->gyro_us;
}

static void write_one(emul_mpu6050_t *chip, uint64_t now_us, uint8_t reg, uint8_t value) {
    if ((chip->reg[PWR_MGMT_1] & RESET) != 0) {
        return;
    }
    if (reg == PWR_MGMT_1) {
        write_power(chip, now_us, value);
    } else if (!sleeps(chip) && kept_bits(chip, reg) != 0) {
        chip->reg[reg] = (uint8_t)(value & kept_bits(chip, reg));
        chip->moved_us = reg == GYRO_CONFIG ? now_us + TEST_US : chip->moved_us;
        if (reg == SMPLRT_DIV || reg == CONFIG) {
            chip->tick_us = (double)now_us + period_us(chip);
        }
    }
}

static uint8_t read_one(emul_mpu6050_t *chip, uint8_t reg, const int16_t shown[EMUL_WORDS]) {
    static const uint8_t order[EMUL_WORDS] = {4, 5, 6, 0, 1, 2, 3}; /* accelerometer, temperature, gyroscope */
    if (reg == WHO_AM_I && chip->wrong_id) {
        return 0x55;
    }
    if (reg >= OUT_FIRST && reg <= OUT_LAST) {
        const uint16_t word = (uint16_t)shown[order[(reg - OUT_FIRST) / 2]];
        return (uint8_t)((reg - OUT_FIRST) % 2 == 0 ? word >> 8 : word & 0xFF);
    }
    if (chip->no_code && reg < SMPLRT_DIV) {
        return 0;
    }
    const uint8_t value = chip->reg[reg];
    if (reg == INT_STATUS) {
        chip->reg[reg] = 0;
    }
    return value;
}

bool emul_mpu6050_i2c_off(const emul_mpu6050_t *chip) {
    return (chip->reg[USER_CTRL] & 0x10u) != 0;
}

static bool silent(const emul_mpu6050_t *chip, uint64_t now_us) {
    return chip->nack || now_us < chip->boot_us;
}

int emul_mpu6050_write(emul_mpu6050_t *chip, uint64_t now_us, uint8_t reg, const uint8_t *data, size_t n) {
    if (silent(chip, now_us)) {
        return -1;
    }
    emul_mpu6050_advance(chip, now_us);
    for (size_t i = 0; i < n; i++) {
        write_one(chip, now_us, (uint8_t)((reg + i) & 0x7F), data[i]);
    }
    return (int)n;
}

int emul_mpu6050_read(emul_mpu6050_t *chip, uint64_t now_us, uint8_t reg, uint8_t *data, size_t n) {
    int16_t shown[EMUL_WORDS];
    if (silent(chip, now_us)) {
        return -1;
    }
    emul_mpu6050_advance(chip, now_us);
    memcpy(shown, chip->inside, sizeof shown);
    for (size_t i = 0; i < n; i++) {
        data[i] = read_one(chip, (uint8_t)((reg + i) & 0x7F), shown);
    }
    return (int)n;
}
