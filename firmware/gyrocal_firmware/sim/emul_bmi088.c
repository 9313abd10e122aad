#include "emul_bmi088.h"

#include <string.h>

enum {
    GYR_CHIP_ID = 0x00,
    RATE_FIRST = 0x02,
    RATE_LAST = 0x07,
    INT_STAT_1 = 0x0A,
    FIFO_STATUS = 0x0E,
    RANGE = 0x0F,
    BANDWIDTH = 0x10,
    LPM1 = 0x11,
    SOFTRESET = 0x14,
    INT_CTRL = 0x15,
    INT3_IO_CONF = 0x16,
    INT3_IO_MAP = 0x18,
    FIFO_WM_EN = 0x1E,
    SELF_TEST = 0x3C,
    FIFO_CONFIG_0 = 0x3D,
    FIFO_CONFIG_1 = 0x3E,
    FIFO_DATA = 0x3F,
    ACC = 0x80, /* what follows is of the accelerometer */
    ACC_CHIP_ID = ACC | 0x00,
    ACC_FIRST = ACC | 0x12,
    ACC_LAST = ACC | 0x17,
    TEMP_MSB = ACC | 0x22,
    TEMP_LSB = ACC | 0x23,
    ACC_CONF = ACC | 0x40,
    ACC_RANGE = ACC | 0x41,
    ACC_PWR_CONF = ACC | 0x7C,
    ACC_PWR_CTRL = ACC | 0x7D,
    ACC_SOFTRESET = ACC | 0x7E,
};

#define BOOT_US 10000u
#define GYR_RESET_US 30000u
#define ACC_RESET_US 1000u
#define ACC_ON_US 450u
#define GYRO_US 30000u
#define READY_US 280u
#define TEST_US 20000u

static const double odr_hz[8] = {2000, 2000, 1000, 400, 200, 100, 200, 100};

static void gyro_defaults(emul_bmi088_t *chip, uint64_t now_us) {
    memset(chip->reg, 0, 128);
    memset(chip->inside + 1, 0, 3 * sizeof chip->inside[0]);
    chip->reg[GYR_CHIP_ID] = 0x0F;
    chip->reg[BANDWIDTH] = 0x80;
    chip->fifo_n = chip->fifo_byte = 0;
    chip->fifo_overrun = false;
    chip->test_us = 0;
    chip->gyro_us = now_us + GYRO_US;
}

static void acc_defaults(emul_bmi088_t *chip) {
    memset(chip->reg + ACC, 0, 128);
    memset(chip->inside + 4, 0, 3 * sizeof chip->inside[0]);
    chip->reg[ACC_CHIP_ID] = 0x1E;
    chip->reg[ACC_CONF] = 0xA8;
    chip->reg[ACC_RANGE] = 0x01;
    chip->reg[ACC_PWR_CONF] = 0x03;
    chip->acc_us = UINT64_MAX;
}

double emul_bmi088_clock_for(double rate_hz) {
    (void)rate_hz; /* its nominal rates are exact */
    return 1.0;
}

void emul_bmi088_power_on(emul_bmi088_t *chip, uint64_t now_us, double world_full_scale_dps) {
    const double clock = chip->clock;
    memset(chip, 0, sizeof *chip);
    chip->clock = clock > 0.0 ? clock : 1.0;
    chip->world_full_scale_dps = world_full_scale_dps;
    chip->boot_us = now_us + BOOT_US;
    gyro_defaults(chip, now_us);
    acc_defaults(chip);
}

void emul_bmi088_brown_out(emul_bmi088_t *chip) {
    gyro_defaults(chip, chip->now_us);
    acc_defaults(chip);
}

static double period_us(const emul_bmi088_t *chip) {
    const bool on = (chip->reg[LPM1] & 0xA0u) == 0;
    return on ? 1e6 / (odr_hz[chip->reg[BANDWIDTH] & 7u] * chip->clock) : 0.0;
}

/* ---- samples ---- */

static void push(emul_bmi088_t *chip) {
    if ((chip->reg[FIFO_CONFIG_1] & 0xC0u) != 0x80) {
        return;
    }
    if (chip->fifo_n == EMUL_BMI088_FRAMES) {
        chip->fifo_overrun = true;
        chip->fifo_first = (chip->fifo_first + 1) % EMUL_BMI088_FRAMES;
        chip->fifo_n--;
        chip->fifo_byte = 0;
    }
    memcpy(chip->fifo[(chip->fifo_first + chip->fifo_n++) % EMUL_BMI088_FRAMES], chip->inside + 1, sizeof chip->fifo[0]);
}

static void sample(emul_bmi088_t *chip, uint64_t now_us) {
    const double full_scale_dps = 2000.0 / (double)(1u << (chip->reg[RANGE] & 7u));
    const double full_scale_g = 3.0 * (double)(1u << (chip->reg[ACC_RANGE] & 3u));
    if (chip->stale || period_us(chip) == 0.0) {
        return;
    }
    for (int i = 0; i < 3; i++) {
        const double dps = chip->world[1 + i] * chip->world_full_scale_dps * EMUL_WORLD_DPS_OF_SCALE;
        const int16_t value = now_us < chip->gyro_us ? 0 : emul_counts(dps * 32768.0 / full_scale_dps);
        chip->inside[1 + i] = (int16_t)(chip->stuck_bit ? value | 4 : value);
        if (now_us >= chip->acc_us) {
            chip->inside[4 + i] = emul_counts(chip->world[4 + i] * EMUL_WORLD_G * 32768.0 / full_scale_g);
        }
    }
    if (now_us >= chip->acc_us) {
        chip->inside[0] = emul_counts((EMUL_WORLD_ZERO_C + chip->world[0] * EMUL_WORLD_C - 23.0) * 8.0);
    }
    chip->sampled_us = now_us;
    push(chip);
}

/* The code of rate and filter together. */
int emul_bmi088_low_pass(const emul_bmi088_t *chip) {
    return chip->reg[BANDWIDTH] & 7u;
}

void emul_bmi088_advance(emul_bmi088_t *chip, uint64_t now_us) {
    const double period = period_us(chip);
    chip->now_us = now_us;
    while (period > 0.0 && (double)now_us >= chip->tick_us && !chip->fed_only) {
        sample(chip, (uint64_t)chip->tick_us);
        chip->tick_us += period;
    }
}

void emul_bmi088_feed(emul_bmi088_t *chip, uint64_t now_us, const int16_t world[EMUL_WORDS]) {
    memcpy(chip->world, world, sizeof chip->world);
    chip->tick_us = (double)now_us + period_us(chip);
    sample(chip, now_us);
}

/* A watermark says that whole batches are read. */
bool emul_bmi088_batches(const emul_bmi088_t *chip) {
    return (chip->reg[FIFO_CONFIG_1] & 0xC0u) == 0x80 && (chip->reg[FIFO_CONFIG_0] & 0x7Fu) > 0;
}

bool emul_bmi088_int1(const emul_bmi088_t *chip) {
    const bool works = (chip->reg[INT3_IO_CONF] & 3u) == 1;
    const bool ready = chip->sampled_us != 0 && chip->now_us - chip->sampled_us < READY_US;
    const unsigned watermark = chip->reg[FIFO_CONFIG_0] & 0x7Fu;
    const bool full_enough = (chip->reg[FIFO_WM_EN] & 0x80u) != 0 && watermark > 0 && chip->fifo_n >= watermark;
    return works && (((chip->reg[INT_CTRL] & 0x80u) != 0 && (chip->reg[INT3_IO_MAP] & 1u) != 0 && ready) ||
                     ((chip->reg[INT_CTRL] & 0x40u) != 0 && (chip->reg[INT3_IO_MAP] & 4u) != 0 && full_enough));
}

/* ---- registers ---- */

static void write_gyro(emul_bmi088_t *chip, uint64_t now_us, uint8_t reg, uint8_t value) {
    if (reg == SOFTRESET && value == 0xB6) {
        gyro_defaults(chip, now_us + GYR_RESET_US);
        chip->reset_us[0] = chip->stuck_reset ? UINT64_MAX : now_us + GYR_RESET_US;
        return;
    }
    if (reg == FIFO_CONFIG_0 || reg == FIFO_CONFIG_1) {
        chip->fifo_n = chip->fifo_byte = 0;
        chip->fifo_overrun = false;
    }
    if (reg == SELF_TEST) {
        chip->test_us = (value & 1u) != 0 ? now_us + TEST_US : 0;
    } else if (reg == BANDWIDTH) {
        chip->reg[reg] = (uint8_t)(0x80u | (value & 0x0Fu));
    } else if ((reg >= RANGE && reg <= 0x3A) || reg == FIFO_CONFIG_0 || reg == FIFO_CONFIG_1) {
        chip->reg[reg] = reg == RANGE ? value & 7u : value;
    }
    if (reg == BANDWIDTH || reg == LPM1) {
        chip->tick_us = (double)now_us + period_us(chip);
    }
}

/* It is woken out of its saving mode first, and switched on then. */
static void write_acc(emul_bmi088_t *chip, uint64_t now_us, uint8_t reg, uint8_t value) {
    if (reg == ACC_SOFTRESET && value == 0xB6) {
        acc_defaults(chip);
        chip->reset_us[1] = chip->stuck_reset ? UINT64_MAX : now_us + ACC_RESET_US;
    } else if (reg == ACC_PWR_CONF) {
        chip->reg[reg] = value;
    } else if (reg == ACC_PWR_CTRL && chip->reg[ACC_PWR_CONF] == 0) {
        chip->reg[reg] = value;
        chip->acc_us = value == 4 ? now_us + ACC_ON_US : UINT64_MAX;
    } else if ((reg == ACC_CONF || reg == ACC_RANGE) && now_us >= chip->acc_us) {
        chip->reg[reg] = reg == ACC_RANGE ? value & 3u : value | 0x80u;
    }
}

static uint8_t fifo_byte(emul_bmi088_t *chip) {
    if (chip->fifo_n == 0) {
        return 0;
    }
    const uint16_t word = (uint16_t)chip->fifo[chip->fifo_first][chip->fifo_byte / 2];
    const uint8_t byte = (uint8_t)(chip->fifo_byte % 2 == 0 ? word & 0xFF : word >> 8);
    if (++chip->fifo_byte == 6) {
        chip->fifo_byte = 0;
        chip->fifo_first = (chip->fifo_first + 1) % EMUL_BMI088_FRAMES;
        chip->fifo_n--;
    }
    return byte;
}

static uint8_t read_one(emul_bmi088_t *chip, uint64_t now_us, uint8_t reg, const int16_t shown[EMUL_WORDS]) {
    if (reg == GYR_CHIP_ID && chip->wrong_id) {
        return 0x55;
    }
    if ((reg >= RATE_FIRST && reg <= RATE_LAST) || (reg >= ACC_FIRST && reg <= ACC_LAST)) {
        const uint16_t word = (uint16_t)shown[reg < ACC ? 1 + (reg - RATE_FIRST) / 2 : 4 + (reg - ACC_FIRST) / 2];
        return (uint8_t)(reg % 2 == 0 ? word & 0xFF : word >> 8);
    }
    switch (reg) {
    case INT_STAT_1:
        return chip->sampled_us != 0 && now_us - chip->sampled_us < READY_US ? 0x80 : 0;
    case FIFO_STATUS:
        return (uint8_t)(chip->fifo_n | (chip->fifo_overrun ? 0x80u : 0u));
    case FIFO_DATA:
        return fifo_byte(chip);
    case SELF_TEST:
        return (uint8_t)(chip->test_us == 0 || now_us < chip->test_us ? 0 : chip->stuck_axes != 0 ? 0x06 : 0x12);
    case TEMP_MSB:
        return (uint8_t)(((uint16_t)shown[0] & 0x7FFu) >> 3);
    case TEMP_LSB:
        return (uint8_t)(((uint16_t)shown[0] & 7u) << 5);
    default:
        return chip->reg[reg];
    }
}

bool emul_bmi088_i2c_off(const emul_bmi088_t *chip) {
    (void)chip; /* its pins choose the bus */
    return false;
}

static bool silent(const emul_bmi088_t *chip, uint64_t now_us, uint8_t reg) {
    return chip->nack || now_us < chip->boot_us || now_us < chip->reset_us[reg < ACC ? 0 : 1];
}

static uint8_t following(uint8_t reg) {
    return reg == FIFO_DATA ? reg : (uint8_t)((reg & ACC) | ((reg + 1) & 0x7F));
}

int emul_bmi088_write(emul_bmi088_t *chip, uint64_t now_us, uint8_t reg, const uint8_t *data, size_t n) {
    if (silent(chip, now_us, reg)) {
        return -1;
    }
    emul_bmi088_advance(chip, now_us);
    for (size_t i = 0; i < n; i++, reg = following(reg)) {
        (reg < ACC ? write_gyro : write_acc)(chip, now_us, reg, data[i]);
    }
    return (int)n;
}

int emul_bmi088_read(emul_bmi088_t *chip, uint64_t now_us, uint8_t reg, uint8_t *data, size_t n) {
    int16_t shown[EMUL_WORDS];
    if (silent(chip, now_us, reg)) {
        return -1;
    }
    emul_bmi088_advance(chip, now_us);
    memcpy(shown, chip->inside, sizeof shown);
    for (size_t i = 0; i < n; i++, reg = following(reg)) {
        data[i] = read_one(chip, now_us, reg, shown);
    }
    return (int)n;
}
