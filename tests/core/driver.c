/* The driver against the emulated part: each check prints its name if it fails. */
#include "emul_lsm6dso.h"
#include "gc_error.h"
#include "gc_lsm6dso.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static uint64_t now;
static emul_lsm6dso_t chip;
static int short_by;
static int fail_in; /* this transfer from now is cut short by half */
static int refuse_writes_to = -1;
static uint8_t written[64][2]; /* the first registers and values since they were counted anew */
static size_t n_written;
static int failures;

#define CHECK(condition)                                       \
    do {                                                       \
        if (!(condition)) {                                    \
            printf("line %d: %s\n", __LINE__, #condition);     \
            failures++;                                        \
        }                                                      \
    } while (0)

static int bus_write(void *context, uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
    (void)context;
    if (address != GC_LSM6DSO_ADDRESS) {
        return -1;
    }
    now += 100;
    if (n_written < sizeof written / sizeof written[0]) {
        written[n_written][0] = reg;
        written[n_written++][1] = data[0];
    }
    return reg == refuse_writes_to ? 0 : emul_lsm6dso_write(&chip, now, reg, data, n);
}

static int bus_read(void *context, uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
    (void)context;
    now += 100;
    if (fail_in > 0 && --fail_in == 0) {
        return emul_lsm6dso_read(&chip, now, reg, data, n / 2);
    }
    const int got = address == GC_LSM6DSO_ADDRESS ? emul_lsm6dso_read(&chip, now, reg, data, n) : -1;
    return got >= 0 && short_by > 0 && n > 1 ? got - short_by : got;
}

static uint64_t now_us(void *context) {
    (void)context;
    return now;
}

static void wait_until_us(void *context, uint64_t t_us) {
    (void)context;
    now = t_us > now ? t_us : now;
}

static uint64_t wait_ready_us(void *context, uint64_t deadline_us) {
    wait_until_us(context, deadline_us);
    return 0;
}

/* INT1 is wired. */
static const gc_port_t port = {.bus_write = bus_write, .bus_read = bus_read, .now_us = now_us, .wait_until_us = wait_until_us,
                               .wait_ready_us = wait_ready_us};
static const gc_port_t port_without_int1 = {.bus_write = bus_write, .bus_read = bus_read, .now_us = now_us,
                                            .wait_until_us = wait_until_us};

static const int16_t pattern[EMUL_WORDS] = {-256, 0x1234, -0x1234, 28571, 16393, -16393, 255};

static int fresh_chip(gc_sensor_t *imu, double odr_hz, double full_scale_dps) {
    now = 0;
    emul_lsm6dso_power_on(&chip, now, 250.0);
    emul_lsm6dso_feed(&chip, now, pattern);
    return gc_sensor_init(imu, &gc_lsm6dso, &port, GC_LSM6DSO_ADDRESS, &(gc_setup_t){.odr_hz = odr_hz, .full_scale_dps = full_scale_dps});
}

static void check_registers_and_words(void) {
    gc_sensor_t imu;
    gc_sample_t s;
    CHECK(fresh_chip(&imu, 416.0, 250.0) == GC_OK);
    CHECK(chip.reg[0x10] == 0x60 && chip.reg[0x11] == 0x60 && chip.reg[0x12] == 0x44);
    CHECK((chip.reg[0x18] & 0x02) && (chip.reg[0x18] & 0xE0) == 0xE0);
    CHECK(now >= 10000u + 80000u && now < 120000u);
    emul_lsm6dso_feed(&chip, now, pattern); /* the chip's next own sample is 2.4 ms away */
    CHECK(gc_sensor_read(&imu, &s) == GC_OK);
    CHECK(s.fresh && s.temp == pattern[0]);
    CHECK(memcmp(s.gyro, pattern + 1, sizeof s.gyro) == 0 && memcmp(s.acc, pattern + 4, sizeof s.acc) == 0);
    now += 500;
    CHECK(gc_sensor_read(&imu, &s) == GC_OK && !s.fresh);
    CHECK(gc_sensor_ready(&imu) == 0);
    now += 3000;
    CHECK(gc_sensor_ready(&imu) == 1);
}

/* A board that restarts finds the part as the program before left it. */
static void check_start_up(void) {
    gc_sensor_t imu;
    const uint8_t high = 0x03, reset = 0x05, bank = 0x80;

    CHECK(fresh_chip(&imu, 416.0, 250.0) == GC_OK);
    emul_lsm6dso_write(&chip, now, 0x0D, &high, 1);
    now += 3000;
    emul_lsm6dso_advance(&chip, now);
    CHECK(emul_lsm6dso_int1(&chip));
    n_written = 0;
    CHECK(gc_sensor_init(&imu, &gc_lsm6dso, &port, GC_LSM6DSO_ADDRESS, &(gc_setup_t){.odr_hz = 416.0, .full_scale_dps = 250.0}) == GC_OK);
    const uint8_t order[][2] = {{0x01, 0}, {0x0D, 0}, {0x18, 0xE2}, {0x12, 0x05}, {0x18, 0xE2}, {0x0D, 0x02}};
    CHECK(n_written >= sizeof order / sizeof order[0] && memcmp(written, order, sizeof order) == 0);

    now += 3000;
    emul_lsm6dso_advance(&chip, now);
    CHECK(emul_lsm6dso_int1(&chip));
    emul_lsm6dso_write(&chip, now, 0x12, &reset, 1); /* as a driver that does not release the pin */
    CHECK(gc_sensor_init(&imu, &gc_lsm6dso, &port, GC_LSM6DSO_ADDRESS, &(gc_setup_t){.odr_hz = 416.0, .full_scale_dps = 250.0}) == GC_E_BUS_NACK);
    CHECK(fresh_chip(&imu, 416.0, 250.0) == GC_OK);

    emul_lsm6dso_write(&chip, now, 0x01, &bank, 1);
    CHECK(gc_sensor_init(&imu, &gc_lsm6dso, &port, GC_LSM6DSO_ADDRESS, &(gc_setup_t){.odr_hz = 416.0, .full_scale_dps = 250.0}) == GC_OK);

    CHECK(gc_sensor_init(&imu, &gc_lsm6dso, &port_without_int1, GC_LSM6DSO_ADDRESS, &(gc_setup_t){.odr_hz = 104.0, .full_scale_dps = 250.0}) == GC_OK);
    CHECK(chip.reg[0x0D] == 0);
    CHECK(gc_sensor_fifo_begin(&imu, 4) == GC_OK && chip.reg[0x0D] == 0);
}

static void check_ranges(void) {
    const double scales[] = {125, 250, 500, 1000, 2000};
    const double lsb[] = {0.004375, 0.00875, 0.0175, 0.035, 0.070};
    const double rates[] = {12.5, 26, 52, 104, 208, 416, 833, 1666};
    gc_sensor_t imu;
    gc_sample_t s;
    for (int i = 0; i < 5; i++) {
        CHECK(fresh_chip(&imu, 416.0, scales[i]) == GC_OK);
        CHECK(imu.lsb_dps == lsb[i]);
        now += 3000;
        CHECK(gc_sensor_read(&imu, &s) == GC_OK);
        CHECK(fabs(s.gyro[0] * imu.lsb_dps - 0x1234 * 0.00875) <= 0.5 * imu.lsb_dps + 1e-9);
    }
    CHECK(fresh_chip(&imu, 416.0, 125.0) == GC_OK);
    now += 3000;
    CHECK(gc_sensor_read(&imu, &s) == GC_OK && s.gyro[2] == 32767);
    for (int i = 0; i < 8; i++) {
        CHECK(fresh_chip(&imu, rates[i], 250.0) == GC_OK);
        const uint64_t start = now;
        emul_lsm6dso_feed(&chip, now, pattern);
        CHECK(gc_sensor_read(&imu, &s) == GC_OK && s.fresh);
        CHECK(gc_sensor_ready(&imu) == 0);
        while (gc_sensor_ready(&imu) == 0) {
            now += 10;
        }
        CHECK(fabs((double)(now - start) - imu.period_us) < 220.0);
        CHECK(fabs(imu.period_us * 6667.0 / (512 >> i) - 1e6) < 1e-3); /* application note AN5192 */
        CHECK(gc_part_odr_for(&gc_lsm6dso, rates[i]) == rates[i]);
    }
    CHECK(gc_part_odr_for(&gc_lsm6dso, 145.0) == 416.0 && gc_part_odr_for(&gc_lsm6dso, 400.0) == 833.0 && gc_part_odr_for(&gc_lsm6dso, 340.0) == 416.0 && gc_part_odr_for(&gc_lsm6dso, 2000.0) == 0.0);
    CHECK(gc_part_odr_for(&gc_lsm6dso, 0.0) == 0.0 && gc_part_odr_for(&gc_lsm6dso, -1.0) == 0.0 && gc_part_odr_for(&gc_lsm6dso, NAN) == 0.0);
    CHECK(fresh_chip(&imu, 145.0, 250.0) == GC_E_ARGUMENT && fresh_chip(&imu, 416.0, 300.0) == GC_E_ARGUMENT);
}

/* Without BDU a word tears when a sample comes between its bytes; with it, it does not. */
static void check_tearing(void) {
    for (int bdu = 0; bdu < 2; bdu++) {
        gc_sensor_t imu;
        uint8_t low, high;
        int16_t other[EMUL_WORDS];
        const uint8_t ctrl3 = bdu ? 0x44 : 0x04;
        CHECK(fresh_chip(&imu, 416.0, 250.0) == GC_OK);
        now += 100000;
        (void)emul_lsm6dso_write(&chip, now, 0x12, &ctrl3, 1);
        emul_lsm6dso_feed(&chip, now, pattern);
        (void)emul_lsm6dso_read(&chip, now, 0x22, &low, 1);
        memcpy(other, pattern, sizeof other);
        other[1] = 0x4321;
        emul_lsm6dso_feed(&chip, now, other);
        (void)emul_lsm6dso_read(&chip, now, 0x23, &high, 1);
        const int word = high << 8 | low;
        CHECK(word == (bdu ? 0x1234 : 0x4334));
        (void)emul_lsm6dso_read(&chip, now, 0x22, &low, 1);
        (void)emul_lsm6dso_read(&chip, now, 0x23, &high, 1);
        CHECK((high << 8 | low) == 0x4321);
    }
}

static void check_faults(void) {
    gc_sensor_t imu;
    gc_sample_t s;

    now = 0;
    emul_lsm6dso_power_on(&chip, now, 250.0);
    CHECK(gc_sensor_init(&imu, &gc_lsm6dso, &port, 0x6A, &(gc_setup_t){.odr_hz = 416.0, .full_scale_dps = 250.0}) == GC_E_BUS_NACK);

    emul_lsm6dso_power_on(&chip, now, 250.0);
    chip.wrong_id = true;
    CHECK(gc_sensor_init(&imu, &gc_lsm6dso, &port, GC_LSM6DSO_ADDRESS, &(gc_setup_t){.odr_hz = 416.0, .full_scale_dps = 250.0}) == GC_E_WRONG_ID);

    emul_lsm6dso_power_on(&chip, now, 250.0);
    chip.stuck_reset = true;
    const uint64_t start = now;
    CHECK(gc_sensor_init(&imu, &gc_lsm6dso, &port, GC_LSM6DSO_ADDRESS, &(gc_setup_t){.odr_hz = 416.0, .full_scale_dps = 250.0}) == GC_E_RESET_TIMEOUT);
    CHECK(now - start < 30000u);

    refuse_writes_to = 0x11;
    CHECK(fresh_chip(&imu, 416.0, 250.0) == GC_E_CONFIG_REFUSED);
    refuse_writes_to = -1;

    CHECK(fresh_chip(&imu, 416.0, 250.0) == GC_OK);
    now += 3000;
    chip.nack = true;
    CHECK(gc_sensor_read(&imu, &s) == GC_E_BUS_NACK);
    chip.nack = false;
    short_by = 1;
    CHECK(gc_sensor_read(&imu, &s) == GC_E_BUS_SHORT);
    short_by = 0;

    /* Frozen: a reading that is there already is not fresh, then stale after three periods of 2.4 ms. */
    emul_lsm6dso_feed(&chip, now, pattern);
    CHECK(gc_sensor_read(&imu, &s) == GC_OK && s.fresh);
    chip.stale = true;
    now += 2500;
    CHECK(gc_sensor_read(&imu, &s) == GC_OK && !s.fresh);
    now += 5500;
    CHECK(gc_sensor_read(&imu, &s) == GC_E_STALE);
    chip.stale = false;
    now += 3000;
    CHECK(gc_sensor_read(&imu, &s) == GC_OK && s.fresh);

    /* A brown-out shows at once as missing data, not after half a second. */
    emul_lsm6dso_brown_out(&chip);
    now += 8000;
    CHECK(gc_sensor_read(&imu, &s) == GC_E_CONFIG_LOST);
    CHECK(gc_sensor_init(&imu, &gc_lsm6dso, &port, GC_LSM6DSO_ADDRESS, &(gc_setup_t){.odr_hz = 416.0, .full_scale_dps = 250.0}) == GC_OK);

    /* One register only, data still coming: seen within half a second. */
    chip.reg[0x11] = 0x6C;
    int error = GC_OK;
    uint64_t changed = now;
    while (error == GC_OK && now - changed < 1000000u) {
        now += 3000;
        error = gc_sensor_read(&imu, &s);
    }
    CHECK(error == GC_E_CONFIG_LOST && now - changed <= 510000u);
}

/* A sample whose every value says which it is. */
static void feed_numbered(int k) {
    const int16_t numbered[EMUL_WORDS] = {(int16_t)(1000 + k), (int16_t)k, (int16_t)-k, (int16_t)(2 * k), (int16_t)(3 * k), (int16_t)(-3 * k), 7};
    emul_lsm6dso_feed(&chip, now, numbered);
}

static bool is_numbered(const gc_sample_t *s, int k) {
    return s->fresh && s->gyro[0] == k && s->gyro[1] == -k && s->gyro[2] == 2 * k && s->acc[0] == 3 * k && s->acc[1] == -3 * k && s->acc[2] == 7;
}

static void begin_fifo(gc_sensor_t *imu, double odr_hz, unsigned batch) {
    chip.fed_only = false;
    CHECK(fresh_chip(imu, odr_hz, 250.0) == GC_OK);
    chip.fed_only = true;
    now += 1000;
    CHECK(gc_sensor_fifo_begin(imu, batch) == GC_OK);
}

static void check_fifo_registers(void) {
    const double rates[] = {12.5, 26, 52, 104, 208, 416, 833, 1666};
    gc_sensor_t imu;
    for (int i = 0; i < 8; i++) {
        begin_fifo(&imu, rates[i], 128);
        CHECK(chip.reg[0x07] == 0 && chip.reg[0x08] == 1); /* 256 words */
        CHECK(chip.reg[0x09] == (i + 1) * 0x11);
        CHECK(chip.reg[0x0A] == (i < 2 ? 0xE6 : 0xF6)); /* continuous; a stamp every 32 samples; temperature at 12.5 or 52 Hz */
        CHECK(chip.reg[0x19] == 0x20);
        CHECK(chip.reg[0x0D] == 0x08);
    }
    begin_fifo(&imu, 3333.0, 128);
    CHECK(chip.reg[0x07] == 128 && chip.reg[0x08] == 0 && chip.reg[0x09] == 0x94); /* the accelerometer at 104 Hz */
    CHECK(gc_sensor_fifo_begin(&imu, 0) == GC_E_ARGUMENT && gc_sensor_fifo_begin(&imu, 129) == GC_E_ARGUMENT);
    refuse_writes_to = 0x09;
    CHECK(fresh_chip(&imu, 104.0, 250.0) == GC_OK && gc_sensor_fifo_begin(&imu, 4) == GC_E_CONFIG_REFUSED);
    refuse_writes_to = -1;
    chip.clock = 1.03;
    CHECK(fresh_chip(&imu, 104.0, 250.0) == GC_OK && fabs(imu.period_us * 6667.0 / 64 * 1.03 - 1e6) < 800.0);
    chip.clock = 0.97;
    CHECK(fresh_chip(&imu, 104.0, 250.0) == GC_OK && fabs(imu.period_us * 6667.0 / 64 * 0.97 - 1e6) < 800.0);
    chip.clock = 1.0;
}

static void check_fifo_words(void) {
    static gc_batch_t batch;
    gc_sensor_t imu;
    int fed = 0, got = 0;
    begin_fifo(&imu, 104.0, 4);
    CHECK(!emul_lsm6dso_int1(&chip));
    for (int round = 0; round < 40; round++) {
        for (int k = 0; k < 1 + round % 7; k++) {
            feed_numbered(fed++);
        }
        CHECK(emul_lsm6dso_int1(&chip) == (2 * (1 + round % 7) + (fed / 2 - (fed - 1 - round % 7) / 2) >= 8));
        CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_OK);
        CHECK(batch.left == 0 && !batch.overrun && !batch.gap && batch.t_us <= now);
        for (unsigned i = 0; i < batch.n; i++) {
            CHECK(is_numbered(&batch.sample[i], got));
            CHECK(got < 4 || (batch.sample[i].temp <= 1000 + got && batch.sample[i].temp >= 1000 + got - 2));
            got++;
        }
        CHECK(got == fed);
    }
    /* The level may be read between the two words of a slot: the other half comes with the next batch. */
    feed_numbered(fed++);
    const unsigned held = chip.fifo_n - 1u;
    chip.fifo_n = 1;
    CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_OK && batch.n == 0);
    chip.fifo_n = held;
    CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_OK && batch.n == 1 && is_numbered(&batch.sample[0], fed - 1));
    CHECK(chip.fifo_n == 0);
    /* A full batch leaves the rest for the next. */
    for (int k = 0; k < 180; k++) {
        feed_numbered(k);
    }
    CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_OK && batch.n >= 100 && abs((int)batch.n + (int)batch.left - 180) <= 1);
    const int first = (int)batch.n;
    CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_OK && (int)batch.n == 180 - first && batch.left == 0 && !batch.gap);
    CHECK(is_numbered(&batch.sample[batch.n - 1], 179));
}

static void check_fifo_losses(void) {
    static gc_batch_t batch;
    gc_sensor_t imu;
    begin_fifo(&imu, 104.0, 4);
    feed_numbered(0);
    const unsigned held = chip.fifo_n - 1u;
    chip.fifo_n = 1; /* half a sample is held when the flood comes */
    CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_OK && batch.n == 0 && !batch.gap);
    chip.fifo_n = held;
    for (int k = 1; k <= 1001; k++) {
        feed_numbered(k);
    }
    CHECK(chip.fifo_n == EMUL_FIFO_WORDS);
    int n = 0, last = 0;
    bool flagged = false;
    do {
        CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_OK);
        flagged = flagged || (batch.overrun && batch.gap && n == 0);
        CHECK(!batch.overrun || n == 0);
        for (unsigned i = 0; i < batch.n; i++, n++) {
            CHECK(n == 0 || batch.sample[i].gyro[0] == last + 1);
            last = batch.sample[i].gyro[0];
            CHECK(is_numbered(&batch.sample[i], last));
        }
    } while (batch.n > 0);
    CHECK(flagged && last == 1001 && n >= 512 * 64 / 162 - 1 && n <= 512 * 64 / 162 + 1); /* 162 words hold 64 samples */

    /* A transfer that breaks off, a damaged tag: what came before counts, the rest is lost and said to be. */
    for (int fault = 0; fault < 2; fault++) {
        begin_fifo(&imu, 104.0, 16);
        for (int k = 0; k < 20; k++) {
            feed_numbered(k);
        }
        if (fault == 0) {
            fail_in = 3; /* status, sixteen words, and now */
        } else {
            chip.fifo[(chip.fifo_first + 20u) % EMUL_FIFO_WORDS][0] ^= 0x10;
        }
        CHECK(gc_sensor_fifo_read(&imu, &batch) == (fault == 0 ? GC_E_BUS_SHORT : GC_E_FIFO_TAG));
        CHECK(batch.n >= 6 && batch.n <= 8 && is_numbered(&batch.sample[batch.n - 1], (int)batch.n - 1));
        CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_OK && batch.n == 0 && batch.gap);
        feed_numbered(77);
        CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_OK && batch.n == 1 && !batch.gap && is_numbered(&batch.sample[0], 77));
    }

    /* Nothing for three periods; a brown-out. */
    begin_fifo(&imu, 104.0, 4);
    now += 20000;
    CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_OK && batch.n == 0);
    now += 20000;
    CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_E_STALE);
    emul_lsm6dso_brown_out(&chip);
    CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_E_CONFIG_LOST);
    begin_fifo(&imu, 104.0, 4);
    chip.reg[0x10] = 0x44;
    feed_numbered(1);
    now += 600000;
    CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_E_CONFIG_LOST && batch.n == 1);
    chip.fed_only = false;
}

/* Another device holds the bus for a while before each transfer. */
static uint64_t had_bus_us;

static int bus_read_later(void *context, uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
    now += 400;
    had_bus_us = now;
    return bus_read(context, address, reg, data, n);
}

static uint64_t bus_us(void *context) {
    (void)context;
    return had_bus_us;
}

static void check_bus_that_is_taken(void) {
    gc_port_t shared = port_without_int1;
    gc_sensor_t imu;
    gc_sample_t s;
    CHECK(fresh_chip(&imu, 416.0, 250.0) == GC_OK);
    imu.port = &shared;
    now += 3000;
    uint64_t before = now;
    CHECK(gc_sensor_read(&imu, &s) == GC_OK && s.fresh && imu.looked_us == before);
    shared.bus_read = bus_read_later;
    shared.bus_us = bus_us;
    now += 3000;
    before = now;
    CHECK(gc_sensor_read(&imu, &s) == GC_OK && s.fresh && imu.looked_us == before + 400u);
}

int main(void) {
    check_bus_that_is_taken();
    check_registers_and_words();
    check_start_up();
    check_ranges();
    check_tearing();
    check_faults();
    check_fifo_registers();
    check_fifo_words();
    check_fifo_losses();
    return failures == 0 ? 0 : 1;
}
