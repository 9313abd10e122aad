#include "gc_icm20948.h"

#include "gc_error.h"
#include "gc_self_test.h"

#include <math.h>

#define POLL_US 1000u
enum { PWR_1, PWR_2, DIVIDER, GYRO, ACCEL, CONFIG_REGS }; /* the watched ones: two of bank 0, three of bank 2 */

static const gc_odr_t odrs[] = {{12.5, 89}, {25.0, 44}, {45.0, 24}, {56.25, 19}, {75.0, 14}, {112.5, 9},
                                {125.0, 8}, {225.0, 4}, {375.0, 2}, {562.5, 1},  {1125.0, 0}};
static const gc_spi_t spi = {.most_hz = 7000000, .mode = 3, .i2c_off_reg = GC_ICM20948_USER_CTRL, .i2c_off = GC_ICM20948_I2C_IF_DIS};
static const gc_range_t ranges[] = {
    {250.0, 1.0 / 131.0, 0x00}, {500.0, 1.0 / 65.5, 0x02}, {1000.0, 1.0 / 32.8, 0x04}, {2000.0, 1.0 / 16.4, 0x06}};

static const gc_accel_t accels[] = {{2.0, 0x00}, {4.0, 0x02}, {8.0, 0x04}, {16.0, 0x06}};

/* The widest filter below half of the output rate. */
static uint8_t filter_code(double odr_hz) {
    static const struct {
        double from_hz;
        uint8_t code;
    } filters[] = {{1125.0, 7}, {562.5, 0}, {375.0, 1}, {112.5, 3}, {56.25, 4}, {25.0, 5}}; /* 361, 197, 152, 51, 24 and 12 Hz */
    for (size_t i = 0; i < sizeof filters / sizeof filters[0]; i++) {
        if (odr_hz >= filters[i].from_hz) {
            return filters[i].code;
        }
    }
    return 6; /* 6 Hz */
}

static int burst(gc_sensor_t *imu, gc_sample_t *sample) {
    uint8_t data[14];
    const int error = gc_sensor_read_regs(imu, GC_ICM20948_ACCEL_XOUT_H, data, sizeof data);
    if (error != GC_OK) {
        return error;
    }
    gc_sensor_words_high_first(data, sample->acc);
    gc_sensor_words_high_first(data + 6, sample->gyro);
    sample->temp = gc_sensor_word(data[12], data[13]);
    imu->data_wait = false;
    return GC_OK;
}

static int select_bank(gc_sensor_t *imu, uint8_t bank) {
    return gc_sensor_write_reg(imu, GC_ICM20948_BANK_SEL, bank);
}

/* Another program may have left another bank selected. */
static int identify(gc_sensor_t *imu) {
    const int error = select_bank(imu, 0);
    return error == GC_OK ? gc_sensor_check_id(imu, 0, imu->part->id_reg, imu->part->id) : error;
}

static int reset(gc_sensor_t *imu) {
    int error = gc_sensor_write_reg(imu, GC_ICM20948_PWR_MGMT_1, GC_ICM20948_RESET);
    if (error == GC_OK) {
        error = gc_sensor_wait_for_bits(imu, GC_ICM20948_PWR_MGMT_1, GC_ICM20948_RESET, 0, POLL_US, GC_ICM20948_RESET_TIMEOUT_US);
    }
    gc_sensor_wait_us(imu, GC_ICM20948_AFTER_RESET_US);
    return error;
}

/* The bank is bank 0 again afterwards, whatever failed. */
static int read_watched(gc_sensor_t *imu, uint8_t *found) {
    int error = gc_sensor_read_regs(imu, GC_ICM20948_PWR_MGMT_1, found, 2);
    if (error == GC_OK) {
        error = select_bank(imu, GC_ICM20948_BANK_2);
    }
    if (error == GC_OK) {
        error = gc_sensor_read_regs(imu, GC_ICM20948_GYRO_SMPLRT_DIV, found + DIVIDER, 2);
    }
    if (error == GC_OK) {
        error = gc_sensor_read_regs(imu, GC_ICM20948_ACCEL_CONFIG, found + ACCEL, 1);
    }
    const int after = select_bank(imu, 0);
    return error != GC_OK ? error : after;
}

static int configure(gc_sensor_t *imu) {
    const uint8_t widest = filter_code(imu->odr_hz);
    const uint8_t filter = (uint8_t)(8u * widest | GC_ICM20948_FILTER_ON);
    const uint8_t low_pass = (uint8_t)(8u * (imu->low_pass > 0u ? imu->low_pass - 1u : widest) | GC_ICM20948_FILTER_ON);
    imu->written[PWR_1] = GC_ICM20948_CLOCK_AUTO;
    imu->written[PWR_2] = 0; /* both sensors on */
    imu->written[DIVIDER] = imu->odr->code;
    imu->written[GYRO] = (uint8_t)(low_pass | imu->range->code);
    imu->written[ACCEL] = (uint8_t)(filter | imu->accel->code);
    const uint8_t steps[][2] = {
        {GC_ICM20948_PWR_MGMT_1, imu->written[PWR_1]},
        {GC_ICM20948_PWR_MGMT_1 + 1, imu->written[PWR_2]},
        {GC_ICM20948_INT_PIN_CFG, GC_ICM20948_LATCH_INT},
        {GC_ICM20948_INT_ENABLE_1, GC_ICM20948_DATA_READY},
        {GC_ICM20948_BANK_SEL, GC_ICM20948_BANK_2},
        {GC_ICM20948_GYRO_SMPLRT_DIV, imu->written[DIVIDER]},
        {GC_ICM20948_GYRO_CONFIG_1, imu->written[GYRO]},
        {GC_ICM20948_ACCEL_SMPLRT_DIV_2, imu->odr->code},
        {GC_ICM20948_ACCEL_CONFIG, imu->written[ACCEL]},
        {GC_ICM20948_BANK_SEL, 0},
    };
    const int error = gc_sensor_write_steps(imu, steps, sizeof steps / sizeof steps[0]);
    return error == GC_OK ? gc_sensor_check_config(imu, GC_E_CONFIG_REFUSED) : error;
}

static int set_up(gc_sensor_t *imu) {
    gc_sample_t first;
    imu->period_us = 1e6 / imu->odr_hz;
    gc_sensor_wait_us(imu, GC_ICM20948_BOOT_US);
    int error = identify(imu);
    if (error == GC_OK) {
        error = reset(imu);
    }
    if (error == GC_OK) {
        error = configure(imu);
    }
    if (error == GC_OK) { /* asleep, the part kept no register but one */
        error = gc_sensor_leave_i2c(imu);
    }
    if (error == GC_OK) {
        gc_sensor_wait_us(imu, GC_ICM20948_TURN_ON_US);
        error = burst(imu, &first);
    }
    return error;
}

static int ready(gc_sensor_t *imu) {
    return gc_sensor_ready_once(imu, GC_ICM20948_INT_STATUS_1, GC_ICM20948_DATA_READY);
}

/* The bank is bank 0 again afterwards, whatever failed. */
static int read_codes(gc_sensor_t *imu, uint8_t code[3]) {
    int error = select_bank(imu, GC_ICM20948_BANK_1);
    if (error == GC_OK) {
        error = gc_sensor_read_regs(imu, GC_ICM20948_SELF_TEST_X_GYRO, code, 3);
    }
    const int after = select_bank(imu, 0);
    return error != GC_OK ? error : after;
}

/* A part without a code fails, and no limit of readings at rest is set. */
static void limit(gc_self_test_t *result, const uint8_t code[3]) {
    gc_self_test_limit_by_code(result, code);
    result->rest_most_dps = NAN;
    for (size_t i = 0; i < 3u; i++) {
        result->least_dps[i] = code[i] > 0u ? result->least_dps[i] : NAN;
    }
}

static int self_test(gc_sensor_t *imu, gc_self_test_t *result) {
    static const uint8_t still[][2] = {
        {GC_ICM20948_LP_CONFIG, GC_ICM20948_GYRO_CYCLE},
        {GC_ICM20948_BANK_SEL, GC_ICM20948_BANK_2},
        {GC_ICM20948_GYRO_SMPLRT_DIV, GC_ICM20948_TEST_DIVIDER},
        {GC_ICM20948_GYRO_CONFIG_1, GC_ICM20948_FILTER_ON},
        {GC_ICM20948_GYRO_CONFIG_2, GC_ICM20948_MEAN_OF_8},
        {GC_ICM20948_BANK_SEL, 0},
    };
    static const uint8_t moving[][2] = {
        {GC_ICM20948_BANK_SEL, GC_ICM20948_BANK_2},
        {GC_ICM20948_GYRO_CONFIG_2, GC_ICM20948_GYRO_TEST | GC_ICM20948_MEAN_OF_8},
        {GC_ICM20948_BANK_SEL, 0},
    };
    static const gc_moving_test_t test = {
        .still = still, .stills = sizeof still / sizeof still[0], .moving = moving, .movings = sizeof moving / sizeof moving[0],
        .settle_us = GC_ICM20948_TEST_US, .samples = 200, .lsb_dps = 1.0 / 131.0};
    uint8_t code[3];
    const int error = read_codes(imu, code);
    if (error != GC_OK) {
        return error;
    }
    limit(result, code);
    return gc_self_test_by_change(imu, &test, result);
}

const gc_part_t gc_icm20948 = {
    .name = "ICM-20948", .id_reg = GC_ICM20948_WHO_AM_I, .id = GC_ICM20948_ID,
    .address = {GC_ICM20948_ADDRESS, GC_ICM20948_ADDRESS_HIGH}, .spi = {&spi},
    .lsb_g = 1.0 / 16384.0, .lsb_c = 1.0 / 333.87, .zero_c = 21.0,
    .noise_dps = 0.23, /* 0.015 dps/sqrt(Hz) within 230 Hz */
    .odr = odrs, .odrs = sizeof odrs / sizeof odrs[0], .polled_from_hz = 562.5,
    .range = ranges, .ranges = sizeof ranges / sizeof ranges[0],
    .accel = accels, .accels = sizeof accels / sizeof accels[0], .low_passes = 8,
    .watched = CONFIG_REGS, .read_watched = read_watched,
    .identify = identify, .set_up = set_up, .ready = ready, .read = burst,
    .self_test = self_test,
};
