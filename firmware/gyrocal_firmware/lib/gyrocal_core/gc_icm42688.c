#include "gc_icm42688.h"

#include "gc_error.h"
#include "gc_self_test.h"

#include <string.h>

enum { POWER, GYRO, ACCEL, FILTERS, CONFIG_REGS }; /* the watched ones */

static const gc_odr_t odrs[] = {{12.5, 11}, {25.0, 10}, {50.0, 9}, {100.0, 8}, {200.0, 7}, {500.0, 15}, {1000.0, 6}};
static const gc_spi_t spi = {.most_hz = 24000000, .mode = 3, .i2c_off_reg = GC_ICM42688_INTF_CONFIG0, .i2c_off = GC_ICM42688_I2C_OFF};
static const gc_range_t ranges[] = {
    {125.0, 1.0 / 262.0, 0x80}, {250.0, 1.0 / 131.0, 0x60}, {500.0, 1.0 / 65.5, 0x40}, {1000.0, 1.0 / 32.8, 0x20}, {2000.0, 1.0 / 16.4, 0x00}};

static const gc_accel_t accels[] = {{2.0, 0x60}, {4.0, 0x40}, {8.0, 0x20}, {16.0, 0x00}};

static int burst(gc_sensor_t *imu, gc_sample_t *sample) {
    uint8_t data[14];
    const int error = gc_sensor_read_regs(imu, GC_ICM42688_TEMP_DATA1, data, sizeof data);
    if (error != GC_OK) {
        return error;
    }
    sample->temp = gc_sensor_word(data[0], data[1]);
    gc_sensor_words_high_first(data + 2, sample->acc);
    gc_sensor_words_high_first(data + 8, sample->gyro);
    imu->data_wait = false;
    return GC_OK;
}

/* Another program may have left another bank selected. */
static int identify(gc_sensor_t *imu) {
    const int error = gc_sensor_write_reg(imu, GC_ICM42688_REG_BANK_SEL, 0);
    return error == GC_OK ? gc_sensor_check_id(imu, 0, imu->part->id_reg, imu->part->id) : error;
}

static int reset(gc_sensor_t *imu) {
    const int error = gc_sensor_write_reg(imu, GC_ICM42688_DEVICE_CONFIG, GC_ICM42688_SOFT_RESET);
    return error != GC_OK ? error
                          : gc_sensor_wait_for_bits(imu, GC_ICM42688_INT_STATUS, GC_ICM42688_RESET_DONE, GC_ICM42688_RESET_DONE,
                                                    GC_ICM42688_RESET_US, GC_ICM42688_RESET_TIMEOUT_US);
}

/* GYRO_CONFIG1 lies among them and keeps its default. */
static int read_watched(gc_sensor_t *imu, uint8_t *found) {
    uint8_t regs[CONFIG_REGS + 1u];
    const int error = gc_sensor_read_regs(imu, GC_ICM42688_PWR_MGMT0, regs, sizeof regs);
    if (error == GC_OK) {
        memcpy(found, regs, FILTERS);
        found[FILTERS] = regs[CONFIG_REGS];
    }
    return error;
}

/* The sensors are switched on last, after all that must not be written soon after it. */
static int configure(gc_sensor_t *imu) {
    imu->written[POWER] = GC_ICM42688_LOW_NOISE;
    imu->written[GYRO] = (uint8_t)(imu->range->code | imu->odr->code);
    imu->written[ACCEL] = (uint8_t)(imu->accel->code | imu->odr->code);
    imu->written[FILTERS] = imu->low_pass > 0u ? (uint8_t)(GC_ICM42688_ACCEL_FILTER_DEFAULT | (imu->low_pass - 1u))
                                               : GC_ICM42688_ACCEL_FILTER_DEFAULT | GC_ICM42688_GYRO_FILTER_DEFAULT;
    const uint8_t steps[][2] = {
        {GC_ICM42688_INT_CONFIG, GC_ICM42688_INT1_LATCHED},
        {GC_ICM42688_INT_CONFIG1, 0},
        {GC_ICM42688_INT_SOURCE0, GC_ICM42688_DATA_READY},
        {GC_ICM42688_PWR_MGMT0 + GYRO, imu->written[GYRO]},
        {GC_ICM42688_PWR_MGMT0 + ACCEL, imu->written[ACCEL]},
        {GC_ICM42688_GYRO_ACCEL_CONFIG0, imu->written[FILTERS]},
        {GC_ICM42688_PWR_MGMT0, imu->written[POWER]},
    };
    const int error = gc_sensor_write_steps(imu, steps, sizeof steps / sizeof steps[0]);
    return error == GC_OK ? gc_sensor_check_config(imu, GC_E_CONFIG_REFUSED) : error;
}

static int set_up(gc_sensor_t *imu) {
    gc_sample_t first;
    imu->period_us = 1e6 / imu->odr_hz;
    gc_sensor_wait_us(imu, GC_ICM42688_BOOT_US);
    int error = identify(imu);
    if (error == GC_OK) {
        error = reset(imu);
    }
    if (error == GC_OK) {
        error = gc_sensor_leave_i2c(imu);
    }
    if (error == GC_OK) {
        error = configure(imu);
    }
    if (error == GC_OK) {
        gc_sensor_wait_us(imu, GC_ICM42688_TURN_ON_US);
        error = burst(imu, &first);
    }
    return error;
}

static int ready(gc_sensor_t *imu) {
    return gc_sensor_ready_once(imu, GC_ICM42688_INT_STATUS, GC_ICM42688_DATA_READY);
}

/* The bank is bank 0 again afterwards, whatever failed. */
static int read_codes(gc_sensor_t *imu, uint8_t code[3]) {
    int error = gc_sensor_write_reg(imu, GC_ICM42688_REG_BANK_SEL, 1);
    if (error == GC_OK) {
        error = gc_sensor_read_regs(imu, GC_ICM42688_XG_ST_DATA, code, 3);
    }
    const int after = gc_sensor_write_reg(imu, GC_ICM42688_REG_BANK_SEL, 0);
    return error != GC_OK ? error : after;
}

static int self_test(gc_sensor_t *imu, gc_self_test_t *result) {
    static const uint8_t still[][2] = {{GC_ICM42688_PWR_MGMT0 + 1, GC_ICM42688_TEST_250_DPS_1_KHZ}};
    static const uint8_t moving[][2] = {{GC_ICM42688_SELF_TEST_CONFIG, GC_ICM42688_GYRO_TEST}};
    static const gc_moving_test_t test = {
        .still = still, .stills = 1, .moving = moving, .movings = 1,
        .settle_us = GC_ICM42688_TEST_US, .samples = 200, .lsb_dps = 1.0 / 131.0};
    uint8_t code[3];
    int error = read_codes(imu, code);
    if (error == GC_OK) {
        error = gc_sensor_change_bits(imu, GC_ICM42688_GYRO_CONFIG1, GC_ICM42688_GYRO_ORDER, GC_ICM42688_GYRO_3RD_ORDER);
    }
    if (error == GC_OK) {
        error = gc_sensor_change_bits(imu, GC_ICM42688_GYRO_ACCEL_CONFIG0, GC_ICM42688_GYRO_FILTER, GC_ICM42688_GYRO_TENTH);
    }
    if (error != GC_OK) {
        return error;
    }
    gc_self_test_limit_by_code(result, code);
    return gc_self_test_by_change(imu, &test, result);
}

const gc_part_t gc_icm42688 = {
    .name = "ICM-42688-P", .id_reg = GC_ICM42688_WHO_AM_I, .id = GC_ICM42688_ID,
    .address = {GC_ICM42688_ADDRESS, GC_ICM42688_ADDRESS_HIGH}, .spi = {&spi},
    .lsb_g = 1.0 / 16384.0, .lsb_c = 1.0 / 132.48, .zero_c = 25.0,
    .noise_dps = 0.033, /* 2.8 mdps/sqrt(Hz) within a quarter of 500 Hz */
    .odr = odrs, .odrs = sizeof odrs / sizeof odrs[0], .polled_from_hz = 500.0,
    .range = ranges, .ranges = sizeof ranges / sizeof ranges[0],
    .accel = accels, .accels = sizeof accels / sizeof accels[0], .low_passes = 8,
    .watched = CONFIG_REGS, .read_watched = read_watched,
    .identify = identify, .set_up = set_up, .ready = ready, .read = burst,
    .self_test = self_test,
};
