/* Every driver against its emulated part, by one table. */
#include "parts_bus.h"

#include "gc_mpu6050.h"

static bool right(const gc_part_t *part, const gc_sensor_t *imu, const gc_sample_t *s) {
    bool all = fabs(part->zero_c + part->lsb_c * s->temp - 22.0) <= 0.51 * part->lsb_c;
    for (int i = 0; i < 3; i++) {
        all = all && fabs(s->gyro[i] * imu->lsb_dps - dps[i]) <= 0.51 * imu->lsb_dps;
        all = all && fabs(s->acc[i] * imu->lsb_g - g[i]) <= 0.51 * imu->lsb_g;
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
    for (size_t i = 0; i < part->odrs && part->odr[i].hz <= GC_FIFO_ALONE_HZ; i++) {
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
    CHECK(gc_part_odr_for(part, 1999.0) == 0.0); /* polled by none of the rates that need the FIFO */
}

/* It is on SPI alone, and nothing was sent to it that its maker does not allow. */
static void check_spi(const gc_part_t *part) {
    gc_sensor_t imu;
    CHECK(set_up(&imu, part, part->odr[part->odrs / 2].hz, 250.0, 1.0) == GC_OK);
    CHECK(emul_i2c_off(&emul) == (by_spi() && part->spi[0]->i2c_off != 0u));
    CHECK(emul.spi_faults == 0u);
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

static void check_accelerometer(const gc_part_t *part) {
    const double hz = part->odr[part->odrs / 2].hz, least_g = part->accel[0].g;
    for (size_t i = 0; i < part->accels; i++) {
        gc_sensor_t imu;
        gc_sample_t s;
        power(1.0);
        const gc_setup_t setup = {.odr_hz = hz, .full_scale_dps = 250.0, .accel_g = part->accel[i].g};
        CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, &setup) == GC_OK);
        (void)wait_for_data(&imu);
        CHECK(gc_sensor_read(&imu, &s) == GC_OK && right(part, &imu, &s));
        CHECK(fabs(imu.lsb_g * 32767.0 / part->accel[i].g - 1.0) < 0.001 && part->accel[i].g == least_g * (double)(1u << i));
        CHECK(gc_part_accel_ok(part, part->accel[i].g));
    }
    CHECK(part->accels == 4u && gc_part_accel_ok(part, 0.0) && !gc_part_accel_ok(part, 5.0) && !gc_part_accel_ok(part, -2.0));
}

/* The filter that low-pass n stands for, as the makers number them. */
static int filter_of(const gc_part_t *part, double hz, unsigned n) {
    if (part->id == 0x0F) {
        return hz == 100.0 ? 5 : hz == 200.0 ? 4 : 0;
    }
    return (int)n;
}

/* Without one the driver's own is in use, and others do not exist. */
static void check_low_pass(const gc_part_t *part) {
    for (size_t i = 0; i < part->odrs; i++) {
        const double hz = part->odr[i].hz;
        gc_sensor_t imu;
        gc_sample_t s;
        CHECK(set_up(&imu, part, hz, 250.0, 1.0) == GC_OK && emul_low_pass(&emul) >= 0);
        unsigned n = 1;
        for (; gc_part_low_pass_ok(part, hz, n); n++) {
            const gc_setup_t setup = {.odr_hz = hz, .full_scale_dps = 250.0, .low_pass = n};
            CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, &setup) == GC_OK);
            CHECK(emul_low_pass(&emul) == filter_of(part, hz, n));
            (void)wait_for_data(&imu);
            CHECK(gc_sensor_read(&imu, &s) == GC_OK && right(part, &imu, &s));
        }
        const gc_setup_t none = {.odr_hz = hz, .full_scale_dps = 250.0, .low_pass = n};
        CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, &none) == GC_E_ARGUMENT && !gc_part_low_pass_ok(part, hz, -1.0));
        CHECK(n - 1u <= part->low_passes && (part->id != 0x69 || part->address[0] != 0x6B || n == 1u));
    }
}

/* The watched registers of parts where they do not lie in a row; the dies and banks of a part have none in common. */
static uint8_t watched_reg(const gc_part_t *part, uint8_t i) {
    static const uint8_t of_icm20948[] = {0x06, 0x07, 0x00, 0x01, 0x14}, of_bmi088[] = {0x0F, 0x10, 0x3E, 0x40, 0x41, 0x7D};
    static const uint8_t of_icm42688[] = {0x4E, 0x4F, 0x50, 0x52};
    const uint8_t *const regs = part->id == 0xEA ? of_icm20948 : part->id == 0x47 ? of_icm42688 : of_bmi088;
    return part->read_watched == NULL ? (uint8_t)(part->watched_reg + i) : regs[i];
}

static void check_faults(const gc_part_t *part) {
    const double hz = part->odr[part->odrs / 2].hz;
    const uint64_t period = (uint64_t)(1e6 / hz);
    gc_sensor_t imu;
    gc_sample_t s;
    power(1.0);
    set_faults(true, false, false, false);
    CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, &(gc_setup_t){.odr_hz = hz, .full_scale_dps = 250.0}) == GC_E_BUS_NACK);
    set_faults(false, true, false, false);
    CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, &(gc_setup_t){.odr_hz = hz, .full_scale_dps = 250.0}) == GC_E_WRONG_ID);
    set_faults(false, false, false, true);
    CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, &(gc_setup_t){.odr_hz = hz, .full_scale_dps = 250.0}) == GC_E_RESET_TIMEOUT);
    for (uint8_t i = 0; i < part->watched; i++) {
        refuse_writes_to = watched_reg(part, i);
        power(1.0);
        const gc_setup_t setup = {.odr_hz = hz, .full_scale_dps = 500.0, .accel_g = part->accel[3].g,
                                  .low_pass = gc_part_low_pass_ok(part, hz, 1.0) ? 1u : 0u};
        const int error = gc_sensor_init(&imu, part, &port, emul.kind->address, &setup);
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
    CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, &(gc_setup_t){.odr_hz = hz, .full_scale_dps = 250.0}) == GC_OK); /* as a board that starts again */
    now += 4 * period;
    CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, &(gc_setup_t){.odr_hz = hz, .full_scale_dps = 250.0}) == GC_OK); /* with data waiting */
    (void)wait_for_data(&imu);
    CHECK(gc_sensor_read(&imu, &s) == GC_OK && right(part, &imu, &s));
    CHECK(gc_sensor_fifo_begin(&imu, part->batch_max + 1u) == GC_E_ARGUMENT);
    CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, &(gc_setup_t){.odr_hz = hz, .full_scale_dps = 300.0}) == GC_E_ARGUMENT);
    CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, &(gc_setup_t){.odr_hz = 145.0, .full_scale_dps = 250.0}) == GC_E_ARGUMENT);
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
        const int error = gc_sensor_fifo_read(&imu, &batch);
        CHECK(error == (!by_spi() ? GC_E_BUS_NACK : part->address[0] == 0x6B ? GC_E_FIFO_TAG : GC_E_CONFIG_LOST));
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
    CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, &(gc_setup_t){.odr_hz = hz, .full_scale_dps = 500.0}) == GC_OK);
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
    CHECK(gc_sensor_init(&imu, part, &port, emul.kind->address, &(gc_setup_t){.odr_hz = part->odr[part->odrs / 2].hz, .full_scale_dps = 250.0}) == GC_OK);
    emul_feed(&emul, now, world);
    (void)wait_for_data(&imu);
    CHECK(gc_sensor_read(&imu, &s) == GC_OK && s.fresh && right(part, &imu, &s)); /* as it was before */
    emul_set_faults(&emul, &silent);
    CHECK(gc_sensor_self_test(&imu, &result) != GC_OK && !result.passed);
    emul_set_faults(&emul, &sound);
}

/* By the part's own time it is known, after however long a flood, how many samples were lost, also where its transfers broke. */
static void check_stamps(const gc_part_t *part) {
    static gc_batch_t batch;
    for (size_t i = 1; i < part->odrs && part->address[0] == 0x6B && part->batch_max > 0u; i++) {
        const double hz = part->odr[i].hz, period_us = 1e6 * emul_clock_for(&emul, hz) / hz / 1.02;
        gc_sensor_t imu;
        unsigned taken = 0, lost = 0;
        bool known = true;
        CHECK(set_up(&imu, part, hz, 500.0, 1.02) == GC_OK && gc_sensor_fifo_begin(&imu, 32) == GC_OK);
        const uint64_t begun = now;
        for (int k = 0; k < 24; k++) {
            const bool flood = k == 8 || k == 16, breaks = k == 12;
            now += (uint64_t)((flood ? 1000.0 + 37.0 * k : 33.0) * period_us);
            if (breaks) {
                set_faults(true, false, false, false);
                CHECK(gc_sensor_fifo_read(&imu, &batch) == (by_spi() ? GC_E_FIFO_TAG : GC_E_BUS_NACK));
                set_faults(false, false, false, false);
                imu.fifo_broken = true; /* as after a transfer in its middle */
                continue;
            }
            do {
                CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_OK && batch.overrun == (flood && batch.gap));
                known = known && (!batch.overrun || batch.lost_known);
                lost += batch.lost;
                taken += batch.n;
            } while (batch.left > 0u);
        }
        const double missing = (double)(now - begun) / period_us - (double)(taken + lost);
        CHECK(known && lost > 1200u && fabs(missing) < 2.5); /* at both ends */
    }
}

/* Where the gyroscope's samples are too many for the bus, the accelerometer's come more slowly; the newest stay with them. */
static void check_accelerometer_in_fifo(const gc_part_t *part) {
    static const int16_t turned[EMUL_WORDS] = {-768, 4571, -6857, 11429, -8197, 12295, -16393};
    static gc_batch_t batch;
    for (size_t i = 1; i < part->odrs && part->batch_max > 0u; i++) {
        const double hz = part->odr[i].hz, period_us = 1e6 * emul_clock_for(&emul, hz) / hz;
        gc_sensor_t imu;
        CHECK(set_up(&imu, part, hz, 250.0, 1.0) == GC_OK && gc_sensor_fifo_begin(&imu, 8) == GC_OK);
        emul_set_world(&emul, turned);
        now += (uint64_t)(fmax(12.0 * period_us, 12000.0));
        do {
            CHECK(gc_sensor_fifo_read(&imu, &batch) == GC_OK && batch.n > 0u);
        } while (batch.left > 0u);
        for (int k = 0; k < 3; k++) {
            CHECK(fabs(batch.sample[batch.n - 1u].acc[k] * imu.lsb_g + g[k]) <= 0.51 * imu.lsb_g);
        }
    }
}

static bool heard(const char *text) {
    return strstr(said, text) != NULL;
}

/* The limits of each axis are told where they differ, and the readings before where the maker limits them. */
static void check_self_test_told(const gc_part_t *part) {
    static const int16_t at_rest[EMUL_WORDS] = {-768, 0, 0, 571, 0, 0, 16393};
    static gc_device_t device;
    const gc_device_config_t config = {.port = &port, .parts = gc_parts, .address = emul.kind->address};
    power(1.0);
    emul_feed(&emul, now, at_rest);
    gc_device_init(&device, &config);
    n_said = 0;
    gc_device_receive(&device, "selftest\n", 9);
    const bool is_st = part->address[0] == 0x6B, is_bosch = isnan(change_dps(part, 0));
    CHECK(heard("$TST,") && heard(",passed=1,") && device.teller.lost == 0u);
    CHECK(heard(",least_dps=150,most_dps=700*") == is_st && heard(",least_dps=,most_dps=*") == is_bosch);
    CHECK(heard(",least_x_dps=") == (!is_st && !is_bosch) && heard(",most_x_dps=") == (part->id == 0x68));
    CHECK(heard(",rest_x_dps=0,") == (!is_st && !is_bosch && part->id != 0x68 && part->id != 0xEA));
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
        CHECK(gc_part_look(gc_parts, &port, &looked) == part->address[by_spi() ? 0u : k] && looked == found);
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
    const char *const elsewhere = by_spi() || emul.kind->address == 0x6B ? "set sensor MPU-6050\n" : "set sensor LSM6DSO\n";
    gc_device_receive(&device, elsewhere, strlen(elsewhere));
    CHECK(heard(by_spi() ? "no_spi" : "bad_argument") && device.sampler.part == found);
}

/* The sensor is exchanged for this one while the device runs, with settings that one of both may not have. */
static void check_exchanged(const gc_part_t *part, const emul_kind_t *kind) {
    static gc_device_t device;
    const gc_device_config_t config = {.port = &port, .parts = gc_parts, .address = kind->address};
    char line[64];
    for (const emul_kind_t *before = emul_kinds; before->name != NULL; before++) {
        if (before->address != kind->address || before->id == kind->id || (by_spi() && strcmp(before->name, "MPU-6050") == 0)) {
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

/* A part that goes is missed: what then is read, the level of a line that nobody drives, is no sample. */
static void check_gone(const gc_part_t *part) {
    gc_sensor_t imu;
    gc_sample_t s;
    const double hz = part->odr[part->odrs / 2].hz;
    CHECK(set_up(&imu, part, hz, 250.0, 1.0) == GC_OK);
    (void)wait_for_data(&imu);
    CHECK(gc_sensor_read(&imu, &s) == GC_OK && s.fresh);
    now += (uint64_t)(2e6 / hz);
    set_faults(true, false, false, false);
    CHECK(gc_sensor_read(&imu, &s) == (by_spi() ? GC_E_CONFIG_LOST : GC_E_BUS_NACK));
    set_faults(false, false, false, false);
}

/* A part without SPI is refused with words, and one is not taken for another by what its other registers hold. */
static void check_others_by_spi(void) {
    gc_sensor_t imu;
    const gc_part_t *found = NULL;
    emul.kind = emul_kind("MPU-6050");
    CHECK(set_up(&imu, &gc_mpu6050, 100.0, 250.0, 1.0) == GC_E_NO_SPI);
    power(1.0);
    CHECK(gc_part_find(gc_parts, &port, 0, &found) == GC_E_BUS_NACK && found == NULL);
    emul.kind = emul_kind("MPU-6500");
    power(1.0);
    for (unsigned i = 0; i < 16u; i++) {
        emul.chip.mpu6050.reg[i] = (uint8_t)(i == 0u ? 0x24 : 0x6C); /* the id of a BMI270 as a code of the self-test, those of an LSM6DSO */
    }
    uint8_t before[128];
    memcpy(before, emul.chip.mpu6050.reg, sizeof before);
    CHECK(gc_part_find(gc_parts, &port, 0, &found) == GC_OK && found == &gc_mpu6500);
    CHECK(memcmp(emul.chip.mpu6050.reg, before, sizeof before) == 0);
}

static void check_all(void) {
    size_t i = 0;
    for (const emul_kind_t *kind = emul_kinds; kind->name != NULL; kind++, i++) {
        const gc_part_t *part = gc_parts[i];
        emul.kind = kind;
        CHECK(part != NULL && strcmp(part->name, kind->name) == 0);
        if (by_spi() && part->spi[0] == NULL) {
            continue;
        }
        emul.spi_faults = 0;
        check_rates(part);
        check_ranges(part);
        check_accelerometer(part);
        check_low_pass(part);
        check_faults(part);
        check_fifo(part);
        check_accelerometer_in_fifo(part);
        check_stamps(part);
        check_self_test(part);
        check_self_test_told(part);
        check_found(part);
        check_gone(part);
        check_spi(part);
        check_exchanged(part, kind); /* which asks for the one at the other's clock */
    }
    emul.kind = emul_kinds;
    CHECK(gc_parts[i] == NULL);
}

int main(void) {
    check_all();
    choose_bus(true);
    check_all();
    check_others_by_spi();
    return failures == 0 ? 0 : 1;
}
