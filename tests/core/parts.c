/* Every driver against its emulated part, by one table: each check prints the part's name and its own if it fails. */
#include "emul.h"
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
    return address != emul.kind->address ? -1 : reg == refuse_writes_to ? (int)n : emul_write(&emul, now, reg, data, n);
}

static int bus_read(void *context, uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
    (void)context;
    now += 70;
    return address == emul.kind->address ? emul_read(&emul, now, reg, data, n) : -1;
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

static const gc_port_t port = {
    .bus_write = bus_write, .bus_read = bus_read, .now_us = now_us, .wait_until_us = wait_until_us, .send = send_text};

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
            uint64_t last = first;
            for (int k = 0; k < 4; k++) {
                last = wait_for_data(&imu);
                CHECK(gc_sensor_read(&imu, &s) == GC_OK && s.fresh);
            }
            const double nominal_us = part->address[0] == 0x6B ? 512e6 / 6667.0 / (double)(1u << i) : 1e6 / part->odr[i].hz;
            CHECK(fabs((double)(last - first) / 4.0 * clock - nominal_us) < 25.0);
            CHECK(fabs(imu.period_us - nominal_us) < 0.031 * nominal_us);
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
        refuse_writes_to = part->watched_reg + i;
        const int error = set_up(&imu, part, hz, 500.0, 1.0);
        CHECK(error == GC_E_CONFIG_REFUSED || (error == GC_OK && imu.written[i] == 0));
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
        CHECK(device.state == GC_STATE_IDLE);
    }
    emul.kind = kind;
}

static void write_reg(uint8_t reg, uint8_t value) {
    now += 70;
    (void)emul_write(&emul, now, reg, &value, 1);
}

static uint8_t read_reg(uint8_t reg) {
    uint8_t value = 0;
    now += 70;
    (void)emul_read(&emul, now, reg, &value, 1);
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
    write_reg(0x6B, 0x80);
    write_reg(0x1B, 0x18); /* resets */
    CHECK((read_reg(0x6B) & 0x80) != 0);
    now += 3000;
    CHECK(read_reg(0x6B) == 0x40 && read_reg(0x1B) == 0);
    write_reg(0x6B, 0);
    write_reg(0x6A, 0x10); /* off this bus */
    CHECK(emul_read(&emul, now, 0x75, &(uint8_t){0}, 1) == -1);
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
    CHECK(emul_read(&emul, now, 0x0F, &(uint8_t){0}, 1) == -1);
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
        check_found(part);
        check_exchanged(part, kind);
    }
    CHECK(gc_parts[i] == NULL);
    emul.kind = emul_kinds;
    check_strict_mpu6050();
    check_strict_icm42688();
    check_strict_older();
    return failures == 0 ? 0 : 1;
}
