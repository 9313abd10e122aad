#include "emul_bmi270.h"

#include <string.h>

enum {
    CHIP_ID = 0x00,
    STATUS = 0x03,
    ACC_FIRST = 0x0C,
    GYR_FIRST = 0x12,
    GYR_LAST = 0x17,
    INT_STATUS_1 = 0x1D,
    INTERNAL_STATUS = 0x21,
    TEMP_FIRST = 0x22,
    FIFO_LENGTH_0 = 0x24,
    FIFO_LENGTH_1 = 0x25,
    FIFO_DATA = 0x26,
    FEAT_PAGE = 0x2F,
    G_TRIG_1 = 0x32,        /* page 1 */
    GYR_GAIN_STATUS = 0x38, /* page 0 */
    ACC_CONF = 0x40,
    ACC_RANGE = 0x41,
    GYR_CONF = 0x42,
    GYR_RANGE = 0x43,
    FIFO_WTM_0 = 0x46,
    FIFO_CONFIG_0 = 0x48,
    FIFO_CONFIG_1 = 0x49,
    INT1_IO_CTRL = 0x53,
    INT_LATCH = 0x55,
    INT_MAP_DATA = 0x58,
    INIT_CTRL = 0x59,
    INIT_ADDR_0 = 0x5B,
    INIT_ADDR_1 = 0x5C,
    INIT_DATA = 0x5E,
    GYR_CRT_CONF = 0x69,
    GYR_SELF_TEST_AXES = 0x6E,
    PWR_CONF = 0x7C,
    PWR_CTRL = 0x7D,
    CMD = 0x7E,
};

#define ID 0x24
#define DRDY_GYR 0x40u
#define DRDY_ACC 0x80u
#define INT_FULL 0x01u
#define INT_WATERMARK 0x02u
#define BOOT_US 500u
#define RESET_US 2000u
#define DEAF_US 450u
#define LOAD_US 20000u
#define GYRO_US 45000u
#define TEST_US 300000u
#define GYRO_OFF_US 1000u
#define RUNNING 0x04u
#define ALL_RIGHT 0x0Fu /* done, and each axis */
#define NOT_PREPARED (1u << 3) /* of GYR_GAIN_STATUS */

static const double odr_hz[16] = {0, 0.78125, 1.5625, 3.125, 6.25, 12.5, 25, 50, 100, 200, 400, 800, 1600, 3200, 0, 0};

const uint8_t *emul_bmi270_file(size_t *n) {
    static uint8_t file[EMUL_BMI270_FILE_BYTES];
    for (unsigned i = 0; i < sizeof file; i++) {
        file[i] = (uint8_t)(167u * i + (i >> 8) + 13u);
    }
    *n = sizeof file;
    return file;
}

static void defaults(emul_bmi270_t *chip) {
    memset(chip->reg, 0, sizeof chip->reg);
    memset(chip->inside, 0, sizeof chip->inside);
    memset(chip->file, 0, sizeof chip->file);
    chip->reg[CHIP_ID] = ID;
    chip->reg[ACC_CONF] = 0xA8;
    chip->reg[ACC_RANGE] = 0x02;
    chip->reg[GYR_CONF] = 0xA9;
    chip->reg[FIFO_CONFIG_0] = 0x02;
    chip->reg[FIFO_CONFIG_1] = 0x10;
    chip->reg[INIT_CTRL] = 0x90;
    chip->reg[PWR_CONF] = 0x03;
    chip->fifo_n = chip->fifo_byte = 0;
    chip->loaded_us = 0;
    chip->gyro_us = UINT64_MAX;
    chip->gyro_off_us = 0;
    chip->trigger[0] = 0;
    chip->trigger[1] = 0;
    chip->test_us = 0;
    chip->test_status = 0;
}

double emul_bmi270_clock_for(double rate_hz) {
    (void)rate_hz; /* its nominal rates are exact */
    return 1.0;
}

void emul_bmi270_power_on(emul_bmi270_t *chip, uint64_t now_us, double world_full_scale_dps) {
    const double clock = chip->clock;
    memset(chip, 0, sizeof *chip);
    chip->clock = clock > 0.0 ? clock : 1.0;
    chip->world_full_scale_dps = world_full_scale_dps;
    chip->boot_us = now_us + BOOT_US;
    defaults(chip);
}

void emul_bmi270_brown_out(emul_bmi270_t *chip) {
    defaults(chip);
}

static bool loaded(const emul_bmi270_t *chip, uint64_t now_us) {
    return chip->loaded_us != 0 && now_us >= chip->loaded_us;
}

static bool gyro_on(const emul_bmi270_t *chip) {
    return (chip->reg[PWR_CTRL] & 2u) != 0;
}

static double period_us(const emul_bmi270_t *chip) {
    const double hz = gyro_on(chip) ? odr_hz[chip->reg[GYR_CONF] & 15] : 0.0;
    return hz > 0.0 ? 1e6 / (hz * chip->clock) : 0.0;
}

/* ---- samples ---- */

static void put_words(uint8_t *bytes, const int16_t values[3]) {
    for (int i = 0; i < 3; i++) {
        bytes[2 * i] = (uint8_t)(values[i] & 0xFF);
        bytes[2 * i + 1] = (uint8_t)((uint16_t)values[i] >> 8);
    }
}

/* Frames of both sensors without headers are the only ones that it emulates. */
static bool stores(const emul_bmi270_t *chip) {
    return (chip->reg[FIFO_CONFIG_1] & 0xF0u) == 0xC0 && (chip->reg[FIFO_CONFIG_0] & 2u) == 0 &&
           (chip->reg[ACC_CONF] & 15u) == (chip->reg[GYR_CONF] & 15u);
}

static unsigned fifo_bytes(const emul_bmi270_t *chip) {
    return EMUL_BMI270_FRAME_BYTES * chip->fifo_n - chip->fifo_byte;
}

static void push(emul_bmi270_t *chip) {
    const unsigned watermark = (unsigned)(chip->reg[FIFO_WTM_0 + 1] & 0x1F) << 8 | chip->reg[FIFO_WTM_0];
    if (chip->fifo_n == EMUL_BMI270_FRAMES) {
        chip->reg[INT_STATUS_1] |= INT_FULL;
        chip->fifo_first = (chip->fifo_first + 1) % EMUL_BMI270_FRAMES;
        chip->fifo_n--;
        chip->fifo_byte = 0;
    }
    uint8_t *frame = chip->fifo[(chip->fifo_first + chip->fifo_n++) % EMUL_BMI270_FRAMES];
    put_words(frame, chip->inside + 1);
    put_words(frame + 6, chip->inside + 4);
    if (watermark > 0 && fifo_bytes(chip) >= watermark) {
        chip->reg[INT_STATUS_1] |= INT_WATERMARK;
    }
}

static void sample(emul_bmi270_t *chip, uint64_t now_us) {
    const double full_scale_dps = 2000.0 / (double)(1u << (chip->reg[GYR_RANGE] & 7u));
    const double full_scale_g = 2.0 * (double)(1u << (chip->reg[ACC_RANGE] & 3u));
    const bool acc_on = (chip->reg[PWR_CTRL] & 4u) != 0;
    if (chip->stale || !loaded(chip, now_us) || !gyro_on(chip)) {
        return;
    }
    const bool temp_on = (chip->reg[PWR_CTRL] & 8u) != 0;
    chip->inside[0] = temp_on ? emul_counts((EMUL_WORLD_ZERO_C + chip->world[0] * EMUL_WORLD_C - 23.0) * 512.0) : INT16_MIN;
    for (int i = 0; i < 3; i++) {
        const double dps = chip->world[1 + i] * chip->world_full_scale_dps * EMUL_WORLD_DPS_OF_SCALE;
        const int16_t value = now_us < chip->gyro_us ? 0 : emul_counts(dps * 32768.0 / full_scale_dps);
        chip->inside[1 + i] = (int16_t)(chip->stuck_bit ? value | 4 : value);
        chip->inside[4 + i] = acc_on ? emul_counts(chip->world[4 + i] * EMUL_WORLD_G * 32768.0 / full_scale_g) : 0;
    }
    chip->reg[STATUS] |= DRDY_GYR | (acc_on ? DRDY_ACC : 0u);
    chip->reg[INT_STATUS_1] |= DRDY_GYR | (acc_on ? DRDY_ACC : 0u);
    if (stores(chip)) {
        push(chip);
    }
}

static void finish_test(emul_bmi270_t *chip, uint64_t now_us) {
    if (chip->test_us == 0 || now_us < chip->test_us) {
        return;
    }
    chip->test_us = 0;
    chip->reg[GYR_CRT_CONF] &= (uint8_t)~RUNNING;
    chip->reg[GYR_SELF_TEST_AXES] = chip->test_status != 0 ? 0 : (uint8_t)(ALL_RIGHT & ~((unsigned)chip->stuck_axes << 1));
}

/* 0 normal, 1 oversampled by two, 2 by four; 3 is reserved. */
int emul_bmi270_low_pass(const emul_bmi270_t *chip) {
    const int mode = chip->reg[GYR_CONF] >> 4 & 3;
    return mode == 3 ? -1 : 2 - mode;
}

void emul_bmi270_advance(emul_bmi270_t *chip, uint64_t now_us) {
    const double period = period_us(chip);
    finish_test(chip, now_us);
    while (period > 0.0 && (double)now_us >= chip->tick_us && !chip->fed_only) {
        sample(chip, (uint64_t)chip->tick_us);
        chip->tick_us += period;
    }
}

void emul_bmi270_feed(emul_bmi270_t *chip, uint64_t now_us, const int16_t world[EMUL_WORDS]) {
    memcpy(chip->world, world, sizeof chip->world);
    chip->tick_us = (double)now_us + period_us(chip);
    sample(chip, now_us);
}

bool emul_bmi270_batches(const emul_bmi270_t *chip) {
    return stores(chip);
}

/* Latched, push-pull and active high; otherwise the pin shows pulses, which nobody who looks sees. */
bool emul_bmi270_int1(const emul_bmi270_t *chip) {
    const bool works = chip->reg[INT1_IO_CTRL] == 0x0A && (chip->reg[INT_LATCH] & 1u) != 0;
    const unsigned map = chip->reg[INT_MAP_DATA], state = chip->reg[INT_STATUS_1];
    return works && (((map & 4u) != 0 && (state & (DRDY_GYR | DRDY_ACC)) != 0) || ((map & 2u) != 0 && (state & INT_WATERMARK) != 0) ||
                     ((map & 1u) != 0 && (state & INT_FULL) != 0));
}

/* ---- registers ---- */

static bool writable(uint8_t reg) {
    return (reg >= ACC_CONF && reg <= FIFO_CONFIG_1) || (reg >= INT1_IO_CTRL && reg <= INIT_ADDR_1) || (reg >= 0x68 && reg <= 0x77 && reg != GYR_SELF_TEST_AXES) ||
           reg == FEAT_PAGE || reg == PWR_CONF || reg == PWR_CTRL;
}

/* Loading begins with a 0 and ends with a 1, out of the saving mode. */
static void write_init(emul_bmi270_t *chip, uint64_t now_us, uint8_t value) {
    size_t n;
    const uint8_t *wanted = emul_bmi270_file(&n);
    const bool awake = (chip->reg[PWR_CONF] & 1u) == 0;
    const bool was_off = (chip->reg[INIT_CTRL] & 1u) == 0;
    chip->reg[INIT_CTRL] = value;
    if ((value & 1u) != 0 && was_off) {
        chip->loaded_us = awake && memcmp(chip->file, wanted, n) == 0 ? now_us + LOAD_US : 0;
    }
}

static void write_file(emul_bmi270_t *chip, const uint8_t *data, size_t n) {
    const size_t at = 2u * ((chip->reg[INIT_ADDR_0] & 15u) | (size_t)chip->reg[INIT_ADDR_1] << 4);
    if ((chip->reg[PWR_CONF] & 1u) == 0 && (chip->reg[INIT_CTRL] & 1u) == 0 && n % 2 == 0 && at + n <= sizeof chip->file) {
        memcpy(chip->file + at, data, n);
    }
}

/* The part wants the gyroscope off, the accelerometer on, no FIFO, and the test chosen and announced. */
static void begin_test(emul_bmi270_t *chip, uint64_t now_us) {
    const bool chosen = chip->trigger[0] == 0 && (chip->trigger[1] & 3u) == 0 && (chip->reg[GYR_CRT_CONF] & RUNNING) != 0;
    const bool off = !gyro_on(chip) && now_us >= chip->gyro_off_us && (chip->reg[FIFO_CONFIG_1] & 0xE0u) == 0;
    const bool prepared = chosen && off && loaded(chip, now_us) && (chip->reg[PWR_CTRL] & 4u) != 0;
    chip->test_us = now_us + (prepared ? TEST_US : 0);
    chip->test_status = prepared ? 0 : NOT_PREPARED;
}

/* Pages are written by words. */
static void write_feature(emul_bmi270_t *chip, uint8_t reg, const uint8_t *data, size_t n) {
    if (chip->reg[FEAT_PAGE] == 1 && reg == G_TRIG_1 && n == 2) {
        memcpy(chip->trigger, data, n);
    }
}

static void write_one(emul_bmi270_t *chip, uint64_t now_us, uint8_t reg, uint8_t value) {
    const bool gyro_was_on = gyro_on(chip);
    if (reg == CMD && value == 0xB6) {
        defaults(chip);
        chip->reset_us = chip->stuck_reset ? UINT64_MAX : now_us + RESET_US;
    } else if (reg == CMD && value == 0xB0) {
        chip->fifo_n = chip->fifo_byte = 0;
    } else if (reg == CMD && value == 0x02) {
        begin_test(chip, now_us);
    } else if (reg == INIT_CTRL) {
        write_init(chip, now_us, value);
    } else if (writable(reg)) {
        static const uint8_t bits_of_acc_range = 0x03, bits_of_gyr_range = 0x0F, bits_of_power = 0x0F;
        chip->reg[reg] = reg == ACC_RANGE   ? value & bits_of_acc_range
                         : reg == GYR_RANGE ? value & bits_of_gyr_range
                         : reg == PWR_CTRL  ? value & bits_of_power
                                            : value;
    }
    if (gyro_on(chip) && !gyro_was_on) {
        chip->gyro_us = now_us + GYRO_US;
    }
    if (!gyro_on(chip) && gyro_was_on) {
        chip->gyro_off_us = now_us + GYRO_OFF_US;
    }
    if (reg == PWR_CTRL || reg == GYR_CONF) {
        chip->tick_us = (double)now_us + period_us(chip);
    }
}

/* Nothing is there beyond its level; such bytes are the marks of an empty frame. */
static uint8_t fifo_byte(emul_bmi270_t *chip) {
    if (chip->fifo_n == 0) {
        return 0x80;
    }
    const uint8_t byte = chip->fifo[chip->fifo_first][chip->fifo_byte++];
    if (chip->fifo_byte == EMUL_BMI270_FRAME_BYTES) {
        chip->fifo_byte = 0;
        chip->fifo_first = (chip->fifo_first + 1) % EMUL_BMI270_FRAMES;
        chip->fifo_n--;
    }
    return byte;
}

static uint8_t read_one(emul_bmi270_t *chip, uint64_t now_us, uint8_t reg, const int16_t shown[EMUL_WORDS]) {
    if (reg == CHIP_ID && chip->wrong_id) {
        return 0x55;
    }
    if (reg >= ACC_FIRST && reg <= GYR_LAST) {
        const uint16_t word = (uint16_t)shown[reg < GYR_FIRST ? 4 + (reg - ACC_FIRST) / 2 : 1 + (reg - GYR_FIRST) / 2];
        chip->reg[STATUS] &= reg < GYR_FIRST ? (uint8_t)~DRDY_ACC : (uint8_t)~DRDY_GYR;
        return (uint8_t)((reg - ACC_FIRST) % 2 == 0 ? word & 0xFF : word >> 8);
    }
    if (reg == INTERNAL_STATUS) {
        return chip->loaded_us == 0 ? ((chip->reg[INIT_CTRL] & 1u) != 0 ? 2 : 0) : loaded(chip, now_us) ? 1 : 0;
    }
    if (reg == GYR_GAIN_STATUS) {
        return chip->reg[FEAT_PAGE] == 0 ? chip->test_status : 0;
    }
    if (reg == TEMP_FIRST || reg == TEMP_FIRST + 1) {
        return (uint8_t)(reg == TEMP_FIRST ? (uint16_t)shown[0] & 0xFF : (uint16_t)shown[0] >> 8);
    }
    if (reg == FIFO_LENGTH_0 || reg == FIFO_LENGTH_1) {
        return (uint8_t)(reg == FIFO_LENGTH_0 ? fifo_bytes(chip) & 0xFF : fifo_bytes(chip) >> 8);
    }
    if (reg == FIFO_DATA) {
        return fifo_byte(chip);
    }
    const uint8_t value = chip->reg[reg];
    if (reg == INT_STATUS_1) {
        chip->reg[reg] = 0;
    }
    return value;
}

bool emul_bmi270_i2c_off(const emul_bmi270_t *chip) {
    (void)chip; /* its pins choose the bus */
    return false;
}

static bool silent(const emul_bmi270_t *chip, uint64_t now_us) {
    return chip->nack || now_us < chip->boot_us || now_us < chip->reset_us;
}

int emul_bmi270_write(emul_bmi270_t *chip, uint64_t now_us, uint8_t reg, const uint8_t *data, size_t n) {
    if (silent(chip, now_us)) {
        return -1;
    }
    emul_bmi270_advance(chip, now_us);
    if (now_us < chip->deaf_us) {
        return (int)n;
    }
    chip->deaf_us = (chip->reg[PWR_CONF] & 1u) != 0 && n > 0 ? now_us + DEAF_US : 0;
    if (reg >= FEAT_PAGE + 1 && reg < ACC_CONF) {
        write_feature(chip, reg, data, n);
        return (int)n;
    }
    if (reg == INIT_DATA) {
        write_file(chip, data, n);
        return (int)n;
    }
    for (size_t i = 0; i < n; i++) {
        write_one(chip, now_us, (uint8_t)((reg + i) & 0x7F), data[i]);
    }
    return (int)n;
}

int emul_bmi270_read(emul_bmi270_t *chip, uint64_t now_us, uint8_t reg, uint8_t *data, size_t n) {
    int16_t shown[EMUL_WORDS];
    if (silent(chip, now_us)) {
        return -1;
    }
    emul_bmi270_advance(chip, now_us);
    memcpy(shown, chip->inside, sizeof shown);
    for (size_t i = 0; i < n; i++) {
        data[i] = read_one(chip, now_us, reg, shown);
        reg = reg == FIFO_DATA ? reg : (uint8_t)((reg + 1) & 0x7F);
    }
    return (int)n;
}
