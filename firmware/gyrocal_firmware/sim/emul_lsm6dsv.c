#include "emul_lsm6dsv.h"

#include <string.h>

enum {
    FUNC_CFG_ACCESS = 0x01,
    IF_CFG = 0x03,
    FIFO_CTRL1 = 0x07,
    FIFO_CTRL3 = 0x09,
    FIFO_CTRL4 = 0x0A,
    INT1_CTRL = 0x0D,
    WHO_AM_I = 0x0F,
    CTRL1 = 0x10,
    CTRL2 = 0x11,
    CTRL3 = 0x12,
    CTRL6 = 0x15,
    CTRL7 = 0x16,
    CTRL8 = 0x17,
    CTRL10 = 0x19,
    FIFO_STATUS1 = 0x1B,
    FIFO_STATUS2 = 0x1C,
    STATUS_REG = 0x1E,
    OUT_FIRST = 0x20,
    OUT_LAST = 0x2D,
    INTERNAL_FREQ = 0x4F,
    FUNCTIONS_ENABLE = 0x50,
    FIFO_TAG = 0x78,
    FIFO_LAST = 0x7E,
};

#define ID 0x70
#define BOOT_US 10000u
#define RESET_US 300u
#define GYRO_US 70000u
#define FREQ_STEP 0.0013
#define TEST_DPS 400.0 /* by which the self-test moves the mass */

static const double odr_hz[16] = {0, 1.875, 7.5, 15, 30, 60, 120, 240, 480, 960, 1920, 3840, 7680, 0, 0, 0};

static void defaults(emul_lsm6dsv_t *chip) {
    memset(chip->reg, 0, sizeof chip->reg);
    memset(chip->inside, 0, sizeof chip->inside);
    chip->reg[WHO_AM_I] = ID;
    chip->reg[CTRL3] = 0x44;
    chip->reg[INTERNAL_FREQ] = (uint8_t)(int)rint((chip->clock - 1.0) / FREQ_STEP);
    chip->fifo_n = 0;
    chip->gyro_us = UINT64_MAX;
}

double emul_lsm6dsv_clock_for(double rate_hz) {
    (void)rate_hz; /* its nominal rates are exact */
    return 1.0;
}

void emul_lsm6dsv_power_on(emul_lsm6dsv_t *chip, uint64_t now_us, double world_full_scale_dps) {
    const double clock = chip->clock;
    memset(chip, 0, sizeof *chip);
    chip->clock = clock > 0.0 ? clock : 1.0;
    chip->world_full_scale_dps = world_full_scale_dps;
    chip->boot_us = now_us + BOOT_US;
    defaults(chip);
}

void emul_lsm6dsv_brown_out(emul_lsm6dsv_t *chip) {
    defaults(chip);
}

static double gyro_hz(const emul_lsm6dsv_t *chip) {
    return odr_hz[chip->reg[CTRL2] & 15];
}

static double acc_hz(const emul_lsm6dsv_t *chip) {
    return odr_hz[chip->reg[CTRL1] & 15];
}

static double period_us(const emul_lsm6dsv_t *chip) {
    const double hz = gyro_hz(chip) > 0.0 ? gyro_hz(chip) : acc_hz(chip);
    return hz > 0.0 ? 1e6 / (hz * chip->clock) : 0.0;
}

/* ---- FIFO ---- */

bool emul_lsm6dsv_batches(const emul_lsm6dsv_t *chip) {
    return (chip->reg[FIFO_CTRL4] & 7u) == 6;
}

static uint8_t fifo_status2(const emul_lsm6dsv_t *chip) {
    const unsigned n = chip->fifo_n, watermark = chip->reg[FIFO_CTRL1];
    return (uint8_t)(n >> 8 | (chip->reg[FIFO_STATUS2] & 8u) | (n == EMUL_LSM6DSV_WORDS ? 0x40u : 0u) |
                     (watermark > 0 && n >= watermark ? 0x80u : 0u));
}

bool emul_lsm6dsv_int1(const emul_lsm6dsv_t *chip) {
    const unsigned wanted = chip->reg[INT1_CTRL], state = chip->reg[STATUS_REG];
    return ((wanted & 1u) != 0 && (state & 1u) != 0) || ((wanted & 2u) != 0 && (state & 2u) != 0) ||
           ((wanted & 8u) != 0 && (fifo_status2(chip) & 0x80u) != 0);
}

static void push(emul_lsm6dsv_t *chip, unsigned tag, const int16_t *values, int n) {
    if (chip->fifo_n == EMUL_LSM6DSV_WORDS) {
        chip->reg[FIFO_STATUS2] |= 8u;
        chip->fifo_first = (chip->fifo_first + 1) % EMUL_LSM6DSV_WORDS;
        chip->fifo_n--;
    }
    uint8_t *word = chip->fifo[(chip->fifo_first + chip->fifo_n++) % EMUL_LSM6DSV_WORDS];
    memset(word, 0, EMUL_LSM6DSV_WORD_BYTES);
    word[0] = (uint8_t)(tag << 3 | (chip->slot & 3u) << 1); /* no parity: bit 0 stays 0 */
    for (int i = 0; i < n; i++) {
        word[1 + 2 * i] = (uint8_t)(values[i] & 0xFF);
        word[2 + 2 * i] = (uint8_t)((uint16_t)values[i] >> 8);
    }
}

/* Whether a word of which there are so many a slot is due. */
static bool due(double *share, double a_slot) {
    *share += fmin(1.0, a_slot);
    const bool yes = *share > 0.999;
    *share -= yes ? 1.0 : 0.0;
    return yes;
}

/* The time runs by the part's clock, six ticks in a sample of 7680 Hz, and stands behind the words of its slot. */
static void stamp(emul_lsm6dsv_t *chip, uint64_t now_us) {
    static const unsigned every[4] = {0, 1, 8, 32};
    const unsigned slots = every[chip->reg[FIFO_CTRL4] >> 6];
    if (slots > 0 && (chip->reg[FUNCTIONS_ENABLE] & 0x40u) != 0 && ++chip->stamped >= slots) {
        const uint64_t ticks = (uint64_t)((chip->fed_only ? (double)now_us : chip->tick_us) * chip->clock * 0.04608);
        const int16_t words[2] = {(int16_t)(ticks & 0xFFFF), (int16_t)(ticks >> 16 & 0xFFFF)};
        chip->stamped = 0;
        push(chip, 4, words, 2);
    }
}

static void batch(emul_lsm6dsv_t *chip, uint64_t now_us) {
    static const double temp_hz[4] = {0, 1.875, 15, 60};
    const double slot_hz = gyro_hz(chip);
    if (!emul_lsm6dsv_batches(chip) || slot_hz == 0.0) {
        return;
    }
    chip->slot++;
    if (odr_hz[chip->reg[FIFO_CTRL3] >> 4] == slot_hz) {
        push(chip, 1, chip->inside + 1, 3);
    }
    if (acc_hz(chip) > 0.0 && due(&chip->acc_due, odr_hz[chip->reg[FIFO_CTRL3] & 15] / slot_hz)) {
        push(chip, 2, chip->inside + 4, 3);
    }
    if (due(&chip->temp_due, temp_hz[chip->reg[FIFO_CTRL4] >> 4 & 3] / slot_hz)) {
        push(chip, 3, chip->inside, 1);
    }
    stamp(chip, now_us);
}

static uint8_t fifo_byte(emul_lsm6dsv_t *chip, uint8_t reg) {
    if (chip->fifo_n == 0) {
        return 0;
    }
    const uint8_t byte = chip->fifo[chip->fifo_first][reg - FIFO_TAG];
    if (reg == FIFO_LAST) {
        chip->fifo_first = (chip->fifo_first + 1) % EMUL_LSM6DSV_WORDS;
        chip->fifo_n--;
    }
    return reg == FIFO_TAG && chip->bad_tags ? 0 : byte;
}

/* ---- samples ---- */

static int16_t rate(const emul_lsm6dsv_t *chip, uint64_t now_us, int axis) {
    static const double lsb_dps[16] = {0.004375, 0.00875, 0.0175, 0.035, 0.07, 0, 0, 0, 0, 0, 0, 0, 0.14, 0, 0, 0};
    const unsigned test = chip->reg[CTRL10] >> 2 & 3u;
    const double moved = emul_is_stuck(chip->stuck_axes, axis) ? 0.0 : test == 1 ? TEST_DPS : test == 2 ? -TEST_DPS : 0.0;
    const double dps = chip->world[1 + axis] * chip->world_full_scale_dps * EMUL_WORLD_DPS_OF_SCALE + moved;
    const double lsb = lsb_dps[chip->reg[CTRL6] & 15];
    const int16_t value = now_us < chip->gyro_us || lsb == 0.0 ? 0 : emul_counts(dps / lsb);
    return (int16_t)(chip->stuck_bit ? value | 4 : value);
}

static void sample(emul_lsm6dsv_t *chip, uint64_t now_us) {
    const double lsb_g = 0.000061 * (double)(1u << (chip->reg[CTRL8] & 3u));
    const bool gyro = gyro_hz(chip) > 0.0, acc = acc_hz(chip) > 0.0;
    if (chip->stale || !(gyro || acc)) {
        return;
    }
    chip->inside[0] = chip->world[0];
    for (int i = 0; i < 3; i++) {
        chip->inside[1 + i] = gyro ? rate(chip, now_us, i) : 0;
        chip->inside[4 + i] = acc ? emul_counts(chip->world[4 + i] * EMUL_WORLD_G / lsb_g) : 0;
    }
    chip->reg[STATUS_REG] = (uint8_t)(chip->reg[STATUS_REG] | (gyro ? 2 : 0) | (acc ? 1 : 0) | 4);
    batch(chip, now_us);
}

/* LPF1_G_BW and one, 0 where LPF1 is off. */
int emul_lsm6dsv_low_pass(const emul_lsm6dsv_t *chip) {
    return (chip->reg[CTRL7] & 1u) != 0 ? (chip->reg[CTRL6] >> 4 & 7) + 1 : 0;
}

void emul_lsm6dsv_advance(emul_lsm6dsv_t *chip, uint64_t now_us) {
    const double period = period_us(chip);
    while (period > 0.0 && (double)now_us >= chip->tick_us && !chip->fed_only) {
        sample(chip, (uint64_t)chip->tick_us);
        chip->tick_us += period;
    }
}

void emul_lsm6dsv_feed(emul_lsm6dsv_t *chip, uint64_t now_us, const int16_t world[EMUL_WORDS]) {
    memcpy(chip->world, world, sizeof chip->world);
    chip->tick_us = (double)now_us + period_us(chip);
    sample(chip, now_us);
}

/* ---- registers ---- */

static bool out_of_reach(const emul_lsm6dsv_t *chip, uint8_t reg) {
    return (chip->reg[FUNC_CFG_ACCESS] & 0xC0u) != 0 && reg != FUNC_CFG_ACCESS;
}

static bool writable(uint8_t reg) {
    return (reg >= FUNC_CFG_ACCESS && reg <= 0x0E) || (reg >= CTRL1 && reg <= CTRL10) || (reg >= 0x50 && reg <= 0x77);
}

static void write_one(emul_lsm6dsv_t *chip, uint64_t now_us, uint8_t reg, uint8_t value) {
    const bool gyro_was_off = gyro_hz(chip) == 0.0;
    if (!writable(reg) || out_of_reach(chip, reg)) {
        return;
    }
    if (reg == CTRL3 && (value & 1u) != 0) {
        const bool runs = gyro_hz(chip) > 0.0 || acc_hz(chip) > 0.0 || emul_lsm6dsv_int1(chip);
        defaults(chip);
        chip->reset_us = chip->stuck_reset || runs ? UINT64_MAX : now_us + RESET_US;
        return;
    }
    chip->reg[reg] = reg == CTRL1 || reg == CTRL2 || reg == CTRL6 ? value & 0x7Fu : reg == CTRL3 ? value & 0xC4u : value;
    if (reg == FIFO_CTRL4 && (value & 7u) == 0) {
        chip->fifo_n = 0;
    }
    if (reg == CTRL2 && gyro_was_off && gyro_hz(chip) > 0.0) {
        chip->gyro_us = now_us + GYRO_US;
    }
    if (reg == CTRL1 || reg == CTRL2) {
        chip->tick_us = (double)now_us + period_us(chip);
    }
}

static uint8_t read_one(emul_lsm6dsv_t *chip, uint64_t now_us, uint8_t reg, const int16_t shown[EMUL_WORDS]) {
    if (out_of_reach(chip, reg)) {
        return 0;
    }
    if (reg == WHO_AM_I && chip->wrong_id) {
        return 0x55;
    }
    if (reg == CTRL3) {
        return (uint8_t)(chip->reg[reg] | (now_us < chip->reset_us ? 1 : 0));
    }
    if (reg == FIFO_STATUS1) {
        return (uint8_t)(chip->fifo_n & 0xFF);
    }
    if (reg == FIFO_STATUS2) {
        const uint8_t status = fifo_status2(chip);
        chip->reg[FIFO_STATUS2] = 0;
        return status;
    }
    if (reg >= FIFO_TAG && reg <= FIFO_LAST) {
        return fifo_byte(chip, reg);
    }
    if (reg >= OUT_FIRST && reg <= OUT_LAST) {
        const int i = (reg - OUT_FIRST) / 2;
        const uint16_t word = (uint16_t)shown[i];
        chip->reg[STATUS_REG] = (uint8_t)(chip->reg[STATUS_REG] & ~(i == 0 ? 4 : i <= 3 ? 2 : 1));
        return (uint8_t)(reg % 2 == 0 ? word & 0xFF : word >> 8);
    }
    return chip->reg[reg];
}

bool emul_lsm6dsv_i2c_off(const emul_lsm6dsv_t *chip) {
    return (chip->reg[IF_CFG] & 1u) != 0;
}

static bool silent(const emul_lsm6dsv_t *chip, uint64_t now_us) {
    return chip->nack || now_us < chip->boot_us;
}

static uint8_t following(const emul_lsm6dsv_t *chip, uint8_t reg) {
    if ((chip->reg[CTRL3] & 0x04) == 0) { /* IF_INC */
        return reg;
    }
    return reg == FIFO_LAST ? FIFO_TAG : (uint8_t)((reg + 1) & 0x7F);
}

int emul_lsm6dsv_write(emul_lsm6dsv_t *chip, uint64_t now_us, uint8_t reg, const uint8_t *data, size_t n) {
    if (silent(chip, now_us)) {
        return -1;
    }
    emul_lsm6dsv_advance(chip, now_us);
    for (size_t i = 0; i < n; i++, reg = following(chip, reg)) {
        write_one(chip, now_us, reg & 0x7F, data[i]);
    }
    return (int)n;
}

int emul_lsm6dsv_read(emul_lsm6dsv_t *chip, uint64_t now_us, uint8_t reg, uint8_t *data, size_t n) {
    int16_t shown[EMUL_WORDS];
    if (silent(chip, now_us)) {
        return -1;
    }
    emul_lsm6dsv_advance(chip, now_us);
    memcpy(shown, chip->inside, sizeof shown);
    for (size_t i = 0; i < n; i++, reg = following(chip, reg)) {
        data[i] = read_one(chip, now_us, reg & 0x7F, shown);
    }
    return (int)n;
}
