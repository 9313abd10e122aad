/* Every driver against its emulated part, by one table: each check prints the part's name and its own if it fails. */
#include "emul.h"
#include "gc_bmi270.h"
#include "gc_device.h"
#include "gc_error.h"
#include "gc_parts.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static uint64_t now;
static emul_t emul;
static int failures;
static int refuse_writes_to = -1;
static char said[65536];
static size_t n_said;

#define CHECK(condition)                                                            \
    do {                                                                            \
        if (!(condition)) {                                                         \
            printf("%s, line %d: %s\n", emul.kind->name, __LINE__, #condition);     \
            failures++;                                                             \
        }                                                                           \
    } while (0)

static int bus_write(void *context, uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
    (void)context;
    now += 70;
    return emul_is_at(&emul, address) && reg == refuse_writes_to ? (int)n : emul_write(&emul, now, address, reg, data, n);
}

static int bus_read(void *context, uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
    (void)context;
    now += 70;
    return emul_read(&emul, now, address, reg, data, n);
}

static uint64_t now_us(void *context) {
    (void)context;
    return now;
}

static void wait_until_us(void *context, uint64_t t_us) {
    (void)context;
    now = t_us > now ? t_us : now;
}

static int send_text(void *context, const char *data, size_t n) {
    (void)context;
    if (n_said + n < sizeof said) {
        memcpy(said + n_said, data, n);
        n_said += n;
        said[n_said] = '\0';
    }
    return (int)n;
}

static const uint8_t *part_file(void *context, const char *part, size_t *n) {
    (void)context;
    return emul_part_file(part, n);
}

static const gc_port_t port = {.bus_write = bus_write, .bus_read = bus_read, .now_us = now_us, .wait_until_us = wait_until_us,
                               .send = send_text, .part_file = part_file};

/* 22 degC, 40, -60 and 100 dps, 0.5, -0.75 and 1 g. */
static const int16_t world[EMUL_WORDS] = {-768, 4571, -6857, 11429, 8197, -12295, 16393};
static const double dps[3] = {4571 * 0.00875, -6857 * 0.00875, 11429 * 0.00875};
static const double g[3] = {8197 * 0.000061, -12295 * 0.000061, 16393 * 0.000061};

static void set_faults(bool nack, bool wrong_id, bool stale, bool stuck_reset) {
    const emul_faults_t faults = {.nack = nack, .wrong_id = wrong_id, .stale = stale, .stuck_reset = stuck_reset};
    emul_set_faults(&emul, &faults);
}

static void power(double clock) {
    now = 0;
    emul_power_on(&emul, clock, now, 250.0);
    emul_feed(&emul, now, world);
    now = 100000;
}

static int set_up(gc_sensor_t *imu, const gc_part_t *part, double odr_hz, double full_scale_dps, double clock) {
    power(clock);
    return gc_sensor_init(imu, part, &port, emul.kind->address, odr_hz, full_scale_dps);
}

static bool right(const gc_part_t *part, const gc_sensor_t *imu, const gc_sample_t *s) {
    bool all = fabs(part->zero_c + part->lsb_c * s->temp - 22.0) <= 0.51 * part->lsb_c;
    for (int i = 0; i < 3; i++) {
        all = all && fabs(s->gyro[i] * imu->lsb_dps - dps[i]) <= 0.51 * imu->lsb_dps;
        all = all && fabs(s->acc[i] * part->lsb_g - g[i]) <= 0.51 * part->lsb_g;
    }
    return all;
}

/* Waits for the data-ready flag and returns its time. */
static uint64_t wait_for_data(gc_sensor_t *imu) {
    const uint64_t start = now;
    while (gc_sensor_ready(imu) == 0 && now - start < 1000000u) {
        now += 5;
    }
    return now;
}

#define LOOKS_US 150.0   /* two transfers, by which both ends of a time are late */
#define RATE_OFF 0.003   /* of a rate; the clocks are 2 and 3 % off */
#define CLOCK_STEP 8e-4  /* half a step of the register in which a part tells its own rate, and a little */

static bool tells_its_clock(const gc_part_t *part) {
    return part->address[0] == 0x6B && part->batch_max > 0u;
}

static void check_rates(const gc_part_t *part) {
    for (size_t i = 0; i < part->odrs; i++) {
        for (int fast = 0; fast < 2; fast++) {
            const double clock = fast ? 1.03 : 0.98;
            gc_sensor_t imu;
            gc_sample_t s;
            CHECK(set_up(&imu, part, part->odr[i].hz, 250.0, clock) == GC_OK);
            (void)wait_for_data(&imu);
            CHECK(gc_sensor_read(&imu, &s) == GC_OK && s.fresh && right(part, &imu, &s));
            CHECK(gc_sensor_ready(&imu) == 0);
            const uint64_t first = wait_for_data(&imu);
            CHECK(gc_sensor_ready(&imu) == 1); /* a look takes nothing away */
            CHECK(gc_sensor_read(&imu, &s) == GC_OK && s.fresh);
            CHECK(gc_sensor_read(&imu, &s) == GC_OK && !s.fresh);
            const double nominal_us = 1e6 * emul_clock_for(&emul, part->odr[i].hz) / part->odr[i].hz;
            const int periods = 4 + (int)(LOOKS_US / (RATE_OFF * nominal_us));
            uint64_t last = first;
            for (int k = 0; k < periods; k++) {
                last = wait_for_data(&imu);
                CHECK(gc_sensor_read(&imu, &s) == GC_OK && s.fresh);
            }
            const double true_us = nominal_us / clock;
            CHECK(fabs((double)(last - first) / periods / true_us - 1.0) < RATE_OFF);
            CHECK(fabs(imu.period_us / (tells_its_clock(part) ? true_us : nominal_us) - 1.0) < CLOCK_STEP);
            CHECK(gc_part_odr_for(part, part->odr[i].hz) == part->odr[i].hz);
        }
    }
    CHECK(gc_part_odr_for(part, 145.0) >= 1.2 * 145.0);
}

static void check_ranges(const gc_part_t *part) {
    for (size_t i = 0; i < part->ranges; i++) {
        gc_sensor_t imu;
        gc_sample_t s;
        CHECK(set_up(&imu, part, part->odr[part->odrs / 2].hz, part->range[i].full_scale_dps, 1.0) == GC_OK);
        (void)wait_for_data(&imu);
        CHECK(gc_sensor_read(&imu, &s) == GC_OK && right(part, &imu, &s));
        CHECK(imu.lsb_dps * 32767.0 >= 0.99 * imu.full_scale_dps && imu.lsb_dps * 32767.0 <= 1.16 * imu.full_scale_dps);
    }
}

/* The watched registers of parts where they do not lie in a row; the dies and banks of a part have none in common. */
static uint8_t watched_reg(const gc_part_t *part, uint8_t i) {
    static const uint8_t of_icm20948[] = {0x06, 0x07, 0x00, 0x01, 0x14}, of_bmi088[] = {0x0F, 0x10, 0x3E, 0x40, 0x41, 0x7D};
    return part->read_watched == NULL ? (uint8_t)(part->watched_reg + i) : part->id == 0xEA ? of_icm20948[i] : of_bmi088[i];
}

static void check_faults(const gc_part_t *part) {
    const double hz = part->odr[part->odrs / 2].hz;
    const uint64_t period = (uint64_t)(1e6 / hz);
    gc_sensor_t imu;
    gc_sample_t s;
    power(1.0);
    set_faults(true, false, false, false);
    CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, hz, 250.0) == GC_E_BUS_NACK);
    set_faults(false, true, false, false);
    CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, hz, 250.0) == GC_E_WRONG_ID);
    set_faults(false, false, false, true);
    CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, hz, 250.0) == GC_E_RESET_TIMEOUT);
    for (uint8_t i = 0; i < part->watched; i++) {
        refuse_writes_to = watched_reg(part, i);
        const int error = set_up(&imu, part, hz, 500.0, 1.0);
        const bool no_reset = refuse_writes_to == 0x06 && error == GC_E_RESET_TIMEOUT;
        const bool was_so = error == GC_OK && (imu.written[i] == 0 || (part->id == 0x70 && refuse_writes_to == 0x12));
        CHECK(error == GC_E_CONFIG_REFUSED || no_reset || was_so);
        refuse_writes_to = -1;
    }
    CHECK(set_up(&imu, part, hz, 250.0, 1.0) == GC_OK);
    (void)wait_for_data(&imu);
    CHECK(gc_sensor_read(&imu, &s) == GC_OK && s.fresh);
    set_faults(false, false, true, false);
    now += 4 * period;
    CHECK(gc_sensor_read(&imu, &s) == GC_E_STALE);
    set_faults(false, false, false, false);
    (void)wait_for_data(&imu);
    CHECK(gc_sensor_read(&imu, &s) == GC_OK && s.fresh);
    emul_brown_out(&emul);
    now += 4 * period;
    CHECK(gc_sensor_read(&imu, &s) == GC_E_CONFIG_LOST);
    CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, hz, 250.0) == GC_OK); /* as a board that starts again */
    now += 4 * period;
    CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, hz, 250.0) == GC_OK); /* with data waiting */
    (void)wait_for_data(&imu);
    CHECK(gc_sensor_read(&imu, &s) == GC_OK && right(part, &imu, &s));
    CHECK(gc_sensor_fifo_begin(&imu, part->batch_max + 1u) == GC_E_ARGUMENT);
    CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, hz, 300.0) == GC_E_ARGUMENT);
    CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, 145.0, 250.0) == GC_E_ARGUMENT);
}

/* Batches are whole and in order, whatever the delay is that the FIFO bridges; a longer one is told. */
static void check_fifo(const gc_part_t *part) {
    static gc_batch_t batch;
    for (size_t i = 1; i < part->odrs && part->batch_max > 0u; i++) {
        const double hz = part->odr[i].hz, period_us = 1e6 * emul_clock_for(&emul, hz) / hz;
        gc_sensor_t imu;
        unsigned taken = 0;
        bool all_right = true;
        CHECK(set_up(&imu, part, hz, 500.0, 1.0) == GC_OK && gc_sensor_fifo_begin(&imu, 8) == GC_OK && emul_batches(&emul));
        const uint64_t begun = now;
        for (int k = 0; k < 12; k++) {
            now += (uint64_t)((k == 5 ? part->batch_max : 8u) * period_us);
            do {
                CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_OK && !batch.overrun && !batch.gap);
                for (unsigned j = 0; j < batch.n; j++) {
                    all_right = all_right && (taken + j == 0u || right(part, &imu, &batch.sample[j]));
                }
                taken += batch.n;
            } while (batch.left > 0u);
        }
        CHECK(all_right && fabs((double)(now - begun) / period_us - taken) < 2.5);
        now += (uint64_t)(4.0 * part->batch_max * period_us + 600000.0);
        CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_OK && batch.overrun && batch.gap);
        while (batch.left > 0u) {
            CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_OK);
        }
        now += (uint64_t)(8.0 * period_us);
        CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_OK && !batch.overrun && batch.n >= 7u && right(part, &imu, &batch.sample[6]));
        set_faults(true, false, false, false);
        CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_E_BUS_NACK);
        set_faults(false, false, true, false);
        now += (uint64_t)(400.0 * period_us);
        (void)gc_sensor_fifo_read(&imu, &batch);
        now += (uint64_t)(4.0 * period_us);
        CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_E_STALE);
        set_faults(false, false, false, false);
    }
}

/* What the emulated self-tests move, and what the makers want; NaN where the part does not tell, or the maker does not mind. */
static double change_dps(const gc_part_t *part, int axis) {
    static const double trims[3] = {12, 17, 9}, codes[3] = {150, 145, 155};
    const double mpu6050_dps = (axis == 1 ? -25.0 : 25.0) * pow(1.046, trims[axis] - 1.0);
    if (part->id == 0x24 || part->id == 0x0F) {
        return NAN;
    }
    return part->address[0] == 0x6B ? 400.0 : 1.05 * (part->id == 0x68 ? mpu6050_dps : 20.0 * pow(1.01, codes[axis] - 1.0));
}

static double limit_dps(const gc_part_t *part, int axis, bool most) {
    const double factory_dps = fabs(change_dps(part, axis)) / 1.05;
    if (part->address[0] == 0x6B) {
        return most ? 700.0 : 150.0;
    }
    return part->id == 0x68 ? (most ? 1.14 : 0.86) * factory_dps : most ? NAN : 0.5 * factory_dps;
}

static bool near_or_absent(double value, double expected) {
    return isnan(expected) ? isnan(value) : fabs(value - expected) < 0.1;
}

static bool passes(const gc_part_t *part, gc_self_test_t *result, const emul_faults_t *faults, int error) {
    const double hz = part->odr[part->odrs / 2].hz;
    gc_sensor_t imu;
    CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, hz, 500.0) == GC_OK);
    emul_set_faults(&emul, faults);
    CHECK(gc_sensor_self_test(&imu, result) == error);
    emul_set_faults(&emul, &(emul_faults_t){.nack = false});
    return result->passed;
}

static void check_self_test(const gc_part_t *part) {
    static const int16_t at_rest[EMUL_WORDS] = {-768, 0, 0, 571, 0, 0, 16393}, fast[EMUL_WORDS] = {-768, 0, 2400, 0, 0, 0, 16393};
    const emul_faults_t sound = {.nack = false}, silent = {.nack = true}, none = {.no_code = true};
    gc_self_test_t result;
    gc_sensor_t imu;
    gc_sample_t s;
    power(1.0);
    emul_feed(&emul, now, at_rest);
    CHECK(part->self_test != NULL && passes(part, &result, &sound, GC_OK));
    for (int i = 0; i < 3; i++) {
        CHECK(near_or_absent(result.change_dps[i], change_dps(part, i)));
        CHECK(near_or_absent(result.least_dps[i], limit_dps(part, i, false)));
        CHECK(near_or_absent(result.most_dps[i], limit_dps(part, i, true)));
    }
    CHECK(near_or_absent(result.rest_dps[2], isnan(change_dps(part, 2)) ? NAN : 571 * 0.00875));
    for (int i = 0; i < 3; i++) {
        const emul_faults_t weak = {.stuck_axes = (uint8_t)(1u << i)};
        CHECK(!passes(part, &result, &weak, GC_OK));
        CHECK(near_or_absent(result.change_dps[i], isnan(change_dps(part, i)) ? NAN : 0.0));
    }
    CHECK(passes(part, &result, &none, GC_OK) == (part->id != 0xEA)); /* its maker wants the codes */
    emul_feed(&emul, now, fast);                                    /* 21 dps */
    CHECK(passes(part, &result, &sound, GC_OK) == isnan(result.rest_most_dps));
    CHECK(part->id != 0x71 || result.rest_most_dps == 20.0);
    CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, part->odr[part->odrs / 2].hz, 250.0) == GC_OK);
    emul_feed(&emul, now, world);
    (void)wait_for_data(&imu);
    CHECK(gc_sensor_read(&imu, &s) == GC_OK && s.fresh && right(part, &imu, &s)); /* as it was before */
    emul_set_faults(&emul, &silent);
    CHECK(gc_sensor_self_test(&imu, &result) != GC_OK && !result.passed);
    emul_set_faults(&emul, &sound);
}

static bool heard(const char *text) {
    return strstr(said, text) != NULL;
}

/* The device finds the part by its id, and takes the one that is set where the id is that of several. */
static void check_found(const gc_part_t *part) {
    static gc_device_t device;
    const gc_device_config_t config = {.port = &port, .parts = gc_parts, .address = emul.kind->address};
    const gc_part_t *found = NULL;
    char line[64];
    power(1.0);
    CHECK(gc_part_find(gc_parts, &port, emul.kind->address, &found) == GC_OK);
    CHECK(found != NULL && found->id == part->id && found->address[0] == part->address[0]);
    for (size_t k = 0; k < 2u; k++) {
        const gc_part_t *looked = NULL;
        emul.address = part->address[k];
        power(1.0);
        CHECK(gc_part_look(gc_parts, &port, &looked) == part->address[k] && looked == found);
    }
    emul.address = 0;
    set_faults(true, false, false, false);
    CHECK(gc_part_look(gc_parts, &port, &found) == gc_parts[0]->address[0] && found == NULL);
    set_faults(false, false, false, false);
    CHECK(gc_part_find(gc_parts, &port, emul.kind->address, &found) == GC_OK);
    power(1.0);
    n_said = 0;
    gc_device_init(&device, &config);
    CHECK(device.sampler.ready && device.sampler.part == found && !heard("$ERR"));
    snprintf(line, sizeof line, "set sensor %s\n", part->name);
    gc_device_receive(&device, line, strlen(line));
    snprintf(line, sizeof line, "sensor=%s,rate_hz=145", part->name);
    CHECK(device.sampler.ready && device.sampler.part == part && heard(line) && !heard("$ERR"));
    gc_device_receive(&device, "set sensor auto\n", 16);
    CHECK(device.sampler.ready && device.sampler.part == found);
    const char *const elsewhere = emul.kind->address == 0x6B ? "set sensor MPU-6050\n" : "set sensor LSM6DSO\n";
    gc_device_receive(&device, elsewhere, strlen(elsewhere));
    CHECK(heard("bad_argument") && device.sampler.part == found);
}

/* The sensor is exchanged for this one while the device runs, with settings that one of both may not have. */
static void check_exchanged(const gc_part_t *part, const emul_kind_t *kind) {
    static gc_device_t device;
    const gc_device_config_t config = {.port = &port, .parts = gc_parts, .address = kind->address};
    char line[64];
    for (const emul_kind_t *before = emul_kinds; before->name != NULL; before++) {
        if (before->address != kind->address || before->id == kind->id) {
            continue;
        }
        emul.kind = before;
        power(1.0);
        gc_device_init(&device, &config);
        static const char *const settings[] = {"set full_scale_dps 2000\n", "set full_scale_dps 4000\n", "set full_scale_dps 125\n"};
        for (size_t i = 0; i < sizeof settings / sizeof settings[0]; i++) {
            gc_device_receive(&device, settings[i], strlen(settings[i]));
        }
        gc_device_receive(&device, "start up\n", 9);
        emul.kind = kind;
        n_said = 0;
        const uint64_t start = now;
        power(1.0);
        now += start;
        emul_power_on(&emul, 1.0, now, 250.0);
        emul_feed(&emul, now, world);
        for (const uint64_t until = now + 4000000u; now < until;) {
            gc_device_step(&device);
        }
        snprintf(line, sizeof line, "sensor=%s,", device.sampler.part->name);
        CHECK(device.sampler.ready && device.sampler.part->id == part->id && heard(line) && heard("state=end"));
        CHECK(device.recorder.state == GC_STATE_IDLE);
    }
    emul.kind = kind;
}

static void write_reg(uint8_t reg, uint8_t value) {
    now += 70;
    (void)emul_write(&emul, now, emul.kind->address, reg, &value, 1);
}

static uint8_t read_reg(uint8_t reg) {
    uint8_t value = 0;
    now += 70;
    (void)emul_read(&emul, now, emul.kind->address, reg, &value, 1);
    return value;
}

/* The emulated parts are strict: what a wrong start-up does is lost. */
static void check_strict_mpu6050(void) {
    emul.kind = emul_kind("MPU-6050");
    power(1.0);
    CHECK(read_reg(0x6B) == 0x40);
    write_reg(0x1B, 0x08); /* asleep */
    CHECK(read_reg(0x1B) == 0);
    write_reg(0x6B, 0x01); /* the gyroscope does not run yet: its clock cannot be taken */
    write_reg(0x1A, 0x01);
    write_reg(0x38, 0x01);
    CHECK(read_reg(0x3A) == 0 && !emul_int1(&emul));
    now += 1200;
    CHECK(!emul_int1(&emul) && read_reg(0x3A) == 1 && read_reg(0x3A) == 0);
    const double slow_us = emul.chip.mpu6050.tick_us;
    now = (uint64_t)slow_us + 1u;
    emul_advance(&emul, now);
    CHECK(fabs(emul.chip.mpu6050.tick_us - slow_us - 1000.0 / 0.97) < 1.0);
    write_reg(0x1B, 0x0C); /* bit 2 is reserved */
    CHECK(read_reg(0x1B) == 0x08);
    write_reg(0x37, 0x20);
    now += 1200;
    emul_advance(&emul, now);
    CHECK(emul_int1(&emul));
    write_reg(0x1B, 0xE8); /* the self-test is for 250 dps */
    now += 300000;
    const uint8_t at_500_dps = read_reg(0x43);
    write_reg(0x1B, 0xE0);
    now += 300000;
    CHECK(at_500_dps == 0x0A && read_reg(0x43) == 0x2A); /* 40 dps, and 43 dps more */
    write_reg(0x6B, 0x80);
    write_reg(0x1B, 0x18); /* resets */
    CHECK((read_reg(0x6B) & 0x80) != 0);
    now += 3000;
    CHECK(read_reg(0x6B) == 0x40 && read_reg(0x1B) == 0);
    write_reg(0x6B, 0);
    write_reg(0x6A, 0x10); /* off this bus */
    CHECK(emul_read(&emul, now, 0x68, 0x75, &(uint8_t){0}, 1) == -1);
}

static void check_strict_icm42688(void) {
    emul.kind = emul_kind("ICM-42688-P");
    power(1.0);
    write_reg(0x76, 1);
    CHECK(read_reg(0x75) == 0);
    write_reg(0x76, 0);
    CHECK(read_reg(0x75) == 0x47);
    write_reg(0x11, 1);
    write_reg(0x4F, 0x66); /* resets */
    now += 1000;
    CHECK(read_reg(0x2D) == 0x10 && read_reg(0x2D) == 0 && read_reg(0x4F) == 0x06);
    write_reg(0x4E, 0x0F);
    write_reg(0x4F, 0x66); /* too early after it */
    CHECK(read_reg(0x4F) == 0x06);
    now += 200;
    write_reg(0x4F, 0x76); /* bit 4 is reserved */
    CHECK(read_reg(0x4F) == 0x66);
    write_reg(0x65, 0x08);
    write_reg(0x14, 0x07);
    now += 2000;
    emul_advance(&emul, now);
    CHECK(!emul_int1(&emul)); /* INT_ASYNC_RESET is set */
    write_reg(0x64, 0);
    CHECK(emul_int1(&emul) && (read_reg(0x2D) & 8) != 0 && !emul_int1(&emul));
}

static void check_strict_older(void) {
    emul.kind = emul_kind("LSM6DS3TR-C");
    power(1.0);
    write_reg(0x0A, 0x06);
    CHECK(!emul_batches(&emul)); /* no such FIFO */
    write_reg(0x18, 0xE2);       /* I3C's bit is reserved */
    CHECK(emul_read(&emul, now, 0x6B, 0x0F, &(uint8_t){0}, 1) == -1);
}

static void check_strict_icm20948(void) {
    emul.kind = emul_kind("ICM-20948");
    power(1.0);
    CHECK(read_reg(0x06) == 0x41);
    write_reg(0x7F, 0x20);
    CHECK(read_reg(0x00) == 0 && read_reg(0x7F) == 0x20);
    write_reg(0x01, 0x3F); /* asleep */
    CHECK(read_reg(0x01) == 0x01);
    write_reg(0x7F, 0x00);
    CHECK(read_reg(0x00) == 0xEA);
    write_reg(0x06, 0x01);
    write_reg(0x14, 0x3F); /* of bank 2 */
    write_reg(0x7F, 0x20);
    CHECK(read_reg(0x14) == 0x01);
    write_reg(0x01, 0xFF); /* two bits are reserved */
    CHECK(read_reg(0x01) == 0x3F);
    write_reg(0x7F, 0x00);
    write_reg(0x11, 0x01);
    now += 2000;
    emul_advance(&emul, now);
    CHECK(!emul_int1(&emul)); /* no latch */
    write_reg(0x0F, 0x20);
    CHECK(emul_int1(&emul) && read_reg(0x1A) == 1 && read_reg(0x1A) == 0);
    write_reg(0x06, 0x80);
    CHECK((read_reg(0x06) & 0x80) != 0);
    now += 3000;
    CHECK(read_reg(0x06) == 0x41);
}

static void check_strict_bmi270(void) {
    size_t n;
    const uint8_t *file = emul_bmi270_file(&n);
    emul.kind = emul_kind("BMI270");
    power(1.0);
    write_reg(0x7C, 0x00);
    write_reg(0x59, 0x00); /* too soon after it */
    CHECK(read_reg(0x59) == 0x90);
    now += 450;
    write_reg(0x7D, 0x0E);
    now += 100000;
    CHECK((read_reg(0x03) & 0x40) == 0 && (read_reg(0x21) & 15) == 0); /* no file */
    write_reg(0x59, 0x00);
    for (size_t at = 0; at + 2 < n; at += 2) { /* all but its end */
        const uint8_t where[] = {(uint8_t)(at / 2 & 15), (uint8_t)(at / 32)};
        (void)emul_write(&emul, now, 0x68, 0x5B, where, 2);
        (void)emul_write(&emul, now, 0x68, 0x5E, file + at, 2);
    }
    write_reg(0x59, 0x01);
    now += 20000;
    CHECK((read_reg(0x21) & 15) == 2);
    gc_port_t without = port;
    gc_sensor_t imu;
    without.part_file = NULL;
    CHECK(gc_sensor_init(&imu, &gc_bmi270, &without, 0x68, 100.0, 250.0) == GC_E_PART_FILE);
    refuse_writes_to = 0x5E;
    CHECK(gc_sensor_init(&imu, &gc_bmi270, &port, 0x68, 100.0, 250.0) == GC_E_PART_FILE_REFUSED);
    refuse_writes_to = -1;
    CHECK(gc_sensor_init(&imu, &gc_bmi270, &port, 0x68, 100.0, 250.0) == GC_OK);
    write_reg(0x69, 0x04);
    write_reg(0x7E, 0x02); /* the gyroscope runs */
    now += 300000;
    CHECK(read_reg(0x69) == 0 && read_reg(0x38) == 0x08 && read_reg(0x6E) == 0);
}

static uint8_t acc_reg(uint8_t reg) {
    uint8_t value = 0;
    (void)emul_read(&emul, now, 0x18, reg, &value, 1);
    return value;
}

static void set_acc_reg(uint8_t reg, uint8_t value) {
    (void)emul_write(&emul, now, 0x18, reg, &value, 1);
}

static void check_strict_bmi088(void) {
    emul.kind = emul_kind("BMI088");
    power(1.0);
    CHECK(read_reg(0x00) == 0x0F && acc_reg(0x00) == 0x1E);
    set_acc_reg(0x7D, 0x04); /* in suspend */
    CHECK(acc_reg(0x7D) == 0);
    set_acc_reg(0x7C, 0x00);
    set_acc_reg(0x7D, 0x04);
    set_acc_reg(0x41, 0x02); /* not on yet */
    CHECK(acc_reg(0x41) == 0x01);
    now += 450;
    set_acc_reg(0x41, 0x02);
    CHECK(acc_reg(0x41) == 0x02);
    write_reg(0x14, 0xB6);
    CHECK(emul_read(&emul, now, 0x68, 0x00, &(uint8_t){0}, 1) == -1 && acc_reg(0x00) == 0x1E);
    now += 30000;
    CHECK(read_reg(0x10) == 0x80);
    write_reg(0x16, 0x01);
    write_reg(0x15, 0x80);
    write_reg(0x18, 0x01);
    now += 600;
    emul_advance(&emul, now);
    const uint64_t tick = (uint64_t)emul_tick_us(&emul) + 1u;
    emul_advance(&emul, tick);
    CHECK(emul_int1(&emul));
    emul_advance(&emul, tick + 300);
    CHECK(!emul_int1(&emul)); /* its state shows for a short time */
    emul.address = 0x69; /* both address pins */
    CHECK(emul_is_at(&emul, 0x69) && emul_is_at(&emul, 0x19) && !emul_is_at(&emul, 0x18));
    emul.address = 0;
}

static void check_strict_lsm6dsv(void) {
    emul.kind = emul_kind("LSM6DSV");
    power(1.0);
    write_reg(0x11, 0x07);
    write_reg(0x12, 0x05); /* a reset while a sensor runs */
    now += 20000;
    CHECK((read_reg(0x12) & 1) == 1);
    power(1.0);
    write_reg(0x03, 0x01); /* I2C is off */
    CHECK(emul_read(&emul, now, 0x6B, 0x0F, &(uint8_t){0}, 1) == -1);
}

int main(void) {
    size_t i = 0;
    for (const emul_kind_t *kind = emul_kinds; kind->name != NULL; kind++, i++) {
        const gc_part_t *part = gc_parts[i];
        emul.kind = kind;
        CHECK(part != NULL && strcmp(part->name, kind->name) == 0);
        check_rates(part);
        check_ranges(part);
        check_faults(part);
        check_fifo(part);
        check_self_test(part);
        check_found(part);
        check_exchanged(part, kind);
    }
    CHECK(gc_parts[i] == NULL);
    emul.kind = emul_kinds;
    check_strict_mpu6050();
    check_strict_icm42688();
    check_strict_icm20948();
    check_strict_bmi270();
    check_strict_bmi088();
    check_strict_lsm6dsv();
    check_strict_older();
    return failures == 0 ? 0 : 1;
}
