#include "emul_lsm6dso.h"

#include <math.h>
#include <string.h>

enum {
    FUNC_CFG_ACCESS = 0x01,
    FIFO_CTRL1 = 0x07,
    FIFO_CTRL2 = 0x08,
    FIFO_CTRL3 = 0x09,
    FIFO_CTRL4 = 0x0A,
    INT1_CTRL = 0x0D,
    WHO_AM_I = 0x0F,
    CTRL1_XL = 0x10,
    CTRL2_G = 0x11,
    CTRL3_C = 0x12,
    CTRL4_C = 0x13,
    CTRL5_C = 0x14,
    CTRL6_C = 0x15,
    CTRL9_XL = 0x18,
    CTRL10_C = 0x19,
    STATUS_REG = 0x1E,
    OUT_FIRST = 0x20,
    OUT_LAST = 0x2D,
    FIFO_STATUS1 = 0x3A,
    FIFO_STATUS2 = 0x3B,
    FIFO_TAG = 0x78,
    FIFO_LAST = 0x7E,
};

enum { ID_DSO = 0x6C, ID_DSR = 0x6B, ID_DS3 = 0x69 };
enum { FIFO_OFF = 0, FIFO_STOPS_WHEN_FULL = 1, FIFO_CONTINUOUS = 6 };
enum { TAG_GYRO = 1, TAG_ACC = 2, TAG_TEMP = 3, TAG_STAMP = 4 };

#define BOOT_US 10000u
#define RESET_US 50u
#define SETTLE_US 70000u
#define TEST_DPS 400.0 /* by which the self-test moves the mass */
#define ROOT_HZ 6667.0 /* AN5192: every output data rate is this rate divided by a power of two */

static const double odr_hz[16] = {0,            ROOT_HZ / 512, ROOT_HZ / 256, ROOT_HZ / 128, ROOT_HZ / 64, ROOT_HZ / 32,
                                  ROOT_HZ / 16, ROOT_HZ / 8,   ROOT_HZ / 4,   ROOT_HZ / 2,   ROOT_HZ};

/* Those with I3C have a FIFO of tagged words and INTERNAL_FREQ_FINE too; the older ones have none of them. */
static bool has_i3c(const emul_lsm6dso_t *chip) {
    return chip->id == ID_DSO || chip->id == ID_DSR;
}

static void defaults(emul_lsm6dso_t *chip) {
    memset(chip->reg, 0, sizeof chip->reg);
    chip->reg[WHO_AM_I] = chip->id;
    chip->reg[CTRL3_C] = 0x04;
    chip->reg[CTRL9_XL] = chip->id == ID_DS3 ? 0x38 : 0xE0;
    chip->reg[0x63] = has_i3c(chip) ? (uint8_t)(int)rint((chip->clock - 1.0) / 0.0015) : 0; /* INTERNAL_FREQ_FINE */
    memset(chip->out, 0, sizeof chip->out);
    memset(chip->half_read, 0, sizeof chip->half_read);
    memset(chip->waiting, 0, sizeof chip->waiting);
    chip->fifo_n = 0;
}

double emul_lsm6dso_clock_for(double rate_hz) {
    return rate_hz * exp2(rint(log2(ROOT_HZ / rate_hz))) / ROOT_HZ;
}

void emul_lsm6dso_power_on(emul_lsm6dso_t *chip, uint64_t now_us, double world_full_scale_dps) {
    const double clock = chip->clock;
    const uint8_t id = chip->id;
    const bool is_32 = chip->is_32;
    memset(chip, 0, sizeof *chip);
    chip->id = id != 0 ? id : ID_DSO;
    chip->is_32 = is_32;
    chip->clock = clock > 0.0 ? clock : 1.0;
    defaults(chip);
    chip->world_full_scale_dps = world_full_scale_dps;
    chip->boot_us = now_us + BOOT_US;
}

void emul_lsm6dso_brown_out(emul_lsm6dso_t *chip) {
    defaults(chip);
}

static double full_scale_dps(const emul_lsm6dso_t *chip) {
    static const double of_bits[] = {250, 500, 1000, 2000};
    if (chip->id == ID_DSR && (chip->reg[CTRL2_G] & 0x01)) {
        return 4000.0;
    }
    return chip->reg[CTRL2_G] & 0x02 ? 125.0 : of_bits[chip->reg[CTRL2_G] >> 2 & 3];
}

static double full_scale_g(const emul_lsm6dso_t *chip) {
    static const double of_bits[] = {2, 16, 4, 8};
    return of_bits[chip->reg[CTRL1_XL] >> 2 & 3] * (chip->is_32 ? 2.0 : 1.0);
}

/* ---- FIFO ---- */

static unsigned fifo_mode(const emul_lsm6dso_t *chip) {
    return has_i3c(chip) ? chip->reg[FIFO_CTRL4] & 7u : FIFO_OFF;
}

bool emul_lsm6dso_batches(const emul_lsm6dso_t *chip) {
    return fifo_mode(chip) != FIFO_OFF;
}

static unsigned watermark(const emul_lsm6dso_t *chip) {
    return (chip->reg[FIFO_CTRL2] & 1u) << 8 | chip->reg[FIFO_CTRL1];
}

static uint8_t fifo_status2(const emul_lsm6dso_t *chip) {
    const unsigned n = chip->fifo_n;
    return (uint8_t)(n >> 8 | (chip->reg[FIFO_STATUS2] & 8u) | (n + 1 >= EMUL_FIFO_WORDS ? 0x20u : 0u) |
                     (n == EMUL_FIFO_WORDS ? 0x40u : 0u) | (watermark(chip) > 0 && n >= watermark(chip) ? 0x80u : 0u));
}

bool emul_lsm6dso_int1(const emul_lsm6dso_t *chip) {
    const unsigned wanted = chip->reg[INT1_CTRL];
    const unsigned fifo = fifo_status2(chip);
    return (wanted & 1u && chip->reg[STATUS_REG] & 1u) || (wanted & 2u && chip->reg[STATUS_REG] & 2u) ||
           (wanted & 8u && fifo & 0x80u) || (wanted & 16u && fifo & 0x40u) || (wanted & 32u && fifo & 0x20u);
}

static void push(emul_lsm6dso_t *chip, unsigned tag, const int16_t *values, int n) {
    uint8_t *word;
    if (chip->fifo_n == EMUL_FIFO_WORDS) {
        chip->reg[FIFO_STATUS2] |= 8u; /* FIFO_OVR_LATCHED */
        if (fifo_mode(chip) == FIFO_STOPS_WHEN_FULL) {
            return;
        }
        chip->fifo_first = (chip->fifo_first + 1) % EMUL_FIFO_WORDS;
        chip->fifo_n--;
    }
    word = chip->fifo[(chip->fifo_first + chip->fifo_n++) % EMUL_FIFO_WORDS];
    memset(word, 0, EMUL_FIFO_WORD_BYTES);
    word[0] = (uint8_t)(tag << 3 | (chip->slot & 3u) << 1);
    for (unsigned bits = word[0]; bits != 0; bits >>= 1) {
        word[0] = (uint8_t)(word[0] ^ (bits & 1u)); /* even parity */
    }
    for (int i = 0; i < n; i++) {
        word[1 + 2 * i] = (uint8_t)(values[i] & 0xFF);
        word[2 + 2 * i] = (uint8_t)((uint16_t)values[i] >> 8);
    }
}

/* Returns true if a word that is batched at rate_hz is due in this time slot of slot_hz. */
static bool due(double *batched, double rate_hz, double slot_hz) {
    *batched += rate_hz >= slot_hz ? 1.0 : rate_hz / slot_hz;
    const bool yes = *batched > 0.999;
    *batched -= yes ? 1.0 : 0.0;
    return yes;
}

/* The time runs by the part's clock, 25 us a tick, and stands before the words of its slot. */
static void stamp(emul_lsm6dso_t *chip, uint64_t now_us) {
    static const unsigned every[] = {0, 1, 8, 32};
    const unsigned slots = every[chip->reg[FIFO_CTRL4] >> 6];
    if (slots > 0 && (chip->reg[CTRL10_C] & 0x20) != 0 && ++chip->stamped >= slots) {
        const uint64_t ticks = (uint64_t)((chip->fed_only ? (double)now_us : chip->tick_us) * chip->clock / 25.0);
        const int16_t words[2] = {(int16_t)(ticks & 0xFFFF), (int16_t)(ticks >> 16 & 0xFFFF)};
        chip->stamped = 0;
        push(chip, TAG_STAMP, words, 2);
    }
}

static void batch(emul_lsm6dso_t *chip, uint64_t now_us, const int16_t value[EMUL_WORDS]) {
    static const double temp_hz[] = {0, ROOT_HZ / 4096, ROOT_HZ / 512, ROOT_HZ / 128};
    const double gyro_hz = odr_hz[chip->reg[FIFO_CTRL3] >> 4];
    const double acc_hz = odr_hz[chip->reg[FIFO_CTRL3] & 15];
    const double slot_hz = odr_hz[chip->reg[CTRL2_G] >> 4] > 0 ? odr_hz[chip->reg[CTRL2_G] >> 4] : odr_hz[chip->reg[CTRL1_XL] >> 4];
    if (!emul_lsm6dso_batches(chip) || slot_hz == 0.0) {
        return;
    }
    chip->slot++;
    stamp(chip, now_us);
    if (due(&chip->batched[0], gyro_hz, slot_hz)) {
        push(chip, TAG_GYRO, value + 1, 3);
    }
    if (due(&chip->batched[1], acc_hz, slot_hz)) {
        push(chip, TAG_ACC, value + 4, 3);
    }
    if (due(&chip->batched[2], temp_hz[chip->reg[FIFO_CTRL4] >> 4 & 3], slot_hz)) {
        push(chip, TAG_TEMP, value, 1);
    }
}

/* Reading the last byte of a word removes the word. An empty FIFO reads zeros. */
static uint8_t fifo_byte(emul_lsm6dso_t *chip, uint8_t reg) {
    uint8_t byte;
    if (chip->fifo_n == 0) {
        return 0;
    }
    byte = chip->fifo[chip->fifo_first][reg - FIFO_TAG];
    if (reg == FIFO_TAG && chip->bad_tags) {
        byte ^= 1u;
    }
    if (reg == FIFO_LAST) {
        chip->fifo_first = (chip->fifo_first + 1) % EMUL_FIFO_WORDS;
        chip->fifo_n--;
    }
    return byte;
}

/* ---- samples ---- */

static int16_t rate(const emul_lsm6dso_t *chip, uint64_t now_us, int axis) {
    const unsigned test = chip->reg[CTRL5_C] >> 2 & 3u; /* 1 = positive, 3 = negative */
    const double moved_dps = emul_is_stuck(chip->stuck_axes, axis) ? 0.0 : test == 1 ? TEST_DPS : test == 3 ? -TEST_DPS : 0.0;
    const double counts = chip->world[1 + axis] * (chip->world_full_scale_dps / full_scale_dps(chip)) + moved_dps / (full_scale_dps(chip) * 3.5e-5);
    const int16_t value = now_us < chip->settled_us || emul_lsm6dso_low_pass(chip) < 0 ? 0 : emul_counts(counts);
    return (int16_t)(chip->stuck_bit ? value | 4 : value);
}

static void sample(emul_lsm6dso_t *chip, uint64_t now_us) {
    int16_t now[EMUL_WORDS];
    const bool gyro = chip->reg[CTRL2_G] >> 4 != 0;
    const bool acc = chip->reg[CTRL1_XL] >> 4 != 0;
    if (chip->stale) {
        return;
    }
    memcpy(now, chip->out, sizeof now);
    for (int i = 0; i < EMUL_WORDS; i++) {
        int16_t value = chip->world[i];
        if ((i == 0 && !gyro && !acc) || (i >= 1 && i <= 3 && !gyro) || (i >= 4 && !acc)) {
            continue;
        }
        if (i >= 1 && i <= 3) {
            value = rate(chip, now_us, i - 1);
        } else if (i >= 4) {
            value = emul_counts(value * (2.0 / full_scale_g(chip)));
        } else if (chip->id == ID_DS3) {
            value = emul_counts(value / 16.0); /* 16 counts a degree */
        }
        now[i] = value;
        if (chip->half_read[i] && (chip->reg[CTRL3_C] & 0x40)) {
            chip->next[i] = value;
            chip->waiting[i] = true;
        } else {
            chip->out[i] = value;
        }
    }
    chip->reg[STATUS_REG] = (uint8_t)(chip->reg[STATUS_REG] | (gyro ? 2 : 0) | (acc ? 1 : 0) | (gyro || acc ? 4 : 0));
    batch(chip, now_us, now);
}

static double period_us(const emul_lsm6dso_t *chip) {
    const double gyro = odr_hz[chip->reg[CTRL2_G] >> 4];
    const double acc = odr_hz[chip->reg[CTRL1_XL] >> 4];
    const double rate = gyro > 0 ? gyro : acc;
    return rate > 0 ? 1e6 / (rate * chip->clock) : 0.0;
}

/* FTYPE and one, 0 where LPF1 is off. Its strong ones end at 1667 Hz, and older parts have two bits of it or none. */
int emul_lsm6dso_low_pass(const emul_lsm6dso_t *chip) {
    const bool on = (chip->reg[CTRL4_C] & 2u) != 0, fast = chip->reg[CTRL2_G] >> 4 > 8;
    const int type = chip->reg[CTRL6_C] & 7u;
    const int types = chip->id == ID_DS3 ? 0 : !has_i3c(chip) || fast ? 4 : 8;
    return !on ? 0 : type < types ? type + 1 : -1;
}

void emul_lsm6dso_advance(emul_lsm6dso_t *chip, uint64_t now_us) {
    const double period = period_us(chip);
    const double now = (double)now_us;
    while (period > 0.0 && now >= chip->tick_us && !chip->fed_only) {
        sample(chip, (uint64_t)chip->tick_us);
        chip->tick_us += period;
    }
}

void emul_lsm6dso_feed(emul_lsm6dso_t *chip, uint64_t now_us, const int16_t world[EMUL_WORDS]) {
    memcpy(chip->world, world, sizeof chip->world);
    chip->tick_us = (double)now_us + period_us(chip);
    sample(chip, now_us);
}

/* While the bank of the embedded functions is selected, the other registers are out of reach. */
static bool out_of_reach(const emul_lsm6dso_t *chip, uint8_t reg) {
    return (chip->reg[FUNC_CFG_ACCESS] & 0xC0) != 0 && reg != FUNC_CFG_ACCESS;
}

static bool writable(uint8_t reg) {
    return reg == FUNC_CFG_ACCESS || (reg >= FIFO_CTRL1 && reg <= FIFO_CTRL4) || reg == INT1_CTRL ||
           (reg >= CTRL1_XL && reg <= CTRL10_C) ||
           (reg > OUT_LAST && reg < FIFO_TAG && reg != FIFO_STATUS1 && reg != FIFO_STATUS2);
}

static void write_one(emul_lsm6dso_t *chip, uint64_t now_us, uint8_t reg, uint8_t value) {
    const bool gyro_was_off = chip->reg[CTRL2_G] >> 4 == 0;
    if (!writable(reg) || out_of_reach(chip, reg)) {
        return;
    }
    if (reg == CTRL3_C && (value & 1)) {
        chip->i3c = has_i3c(chip) && emul_lsm6dso_int1(chip); /* a real part may: the pin's level chooses the bus */
        defaults(chip);
        chip->reset_us = chip->stuck_reset ? UINT64_MAX : now_us + RESET_US;
        return;
    }
    chip->reg[reg] = value;
    chip->spoilt = chip->spoilt || (reg == CTRL9_XL && !has_i3c(chip) && (value & 0x03) != 0);
    if (reg == FIFO_CTRL4 && fifo_mode(chip) == FIFO_OFF) {
        chip->fifo_n = 0;
    }
    if (reg == CTRL2_G && gyro_was_off && value >> 4 != 0) {
        chip->settled_us = now_us + SETTLE_US;
    }
    if (reg == CTRL1_XL || reg == CTRL2_G) {
        chip->tick_us = (double)now_us + period_us(chip);
    }
}

static uint8_t read_one(emul_lsm6dso_t *chip, uint64_t now_us, uint8_t reg) {
    if (out_of_reach(chip, reg)) {
        return 0;
    }
    if (reg == WHO_AM_I && chip->wrong_id) {
        return 0x55;
    }
    if (reg == CTRL3_C) {
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

bool emul_lsm6dso_i2c_off(const emul_lsm6dso_t *chip) {
    return (chip->reg[CTRL4_C] & 0x04u) != 0;
}

static bool silent(const emul_lsm6dso_t *chip, uint64_t now_us) {
    return chip->nack || chip->i3c || chip->spoilt || now_us < chip->boot_us;
}

static uint8_t following(const emul_lsm6dso_t *chip, uint8_t reg) {
    if (!(chip->reg[CTRL3_C] & 0x04)) { /* IF_INC */
        return reg;
    }
    return reg == FIFO_LAST ? FIFO_TAG : (uint8_t)((reg + 1) & 0x7F);
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
