#include "gc_mpu6050.h"

#include "gc_error.h"
#include "gc_self_test.h"

#define CONFIG_REGS 4u /* SMPLRT_DIV, CONFIG, GYRO_CONFIG, ACCEL_CONFIG; some parts have ACCEL_CONFIG_2 behind them */
#define POLL_US 1000u

/* 1 kHz over the divider and one. */
static const gc_odr_t odrs[] = {{10.0, 99}, {20.0, 49},  {25.0, 39},  {50.0, 19},  {100.0, 9},
                                {125.0, 7}, {200.0, 4}, {250.0, 3}, {500.0, 1}, {1000.0, 0}};
static const gc_spi_t spi = {.most_hz = 1000000, .mode = 3, .i2c_off_reg = GC_MPU6500_USER_CTRL, .i2c_off = GC_MPU6500_I2C_IF_DIS};
static const gc_range_t ranges[] = {
    {250.0, 1.0 / 131.0, 0x00}, {500.0, 1.0 / 65.5, 0x08}, {1000.0, 1.0 / 32.8, 0x10}, {2000.0, 1.0 / 16.4, 0x18}};

static const gc_accel_t accels[] = {{2.0, 0x00}, {4.0, 0x08}, {8.0, 0x10}, {16.0, 0x18}};

/* The widest filter below half of the output rate: 188, 98, 42, 20, 10 or 5 Hz. */
static uint8_t filter_code(double odr_hz) {
    static const double from_hz[] = {500.0, 200.0, 100.0, 50.0, 20.0};
    uint8_t code = 1;
    while (code <= sizeof from_hz / sizeof from_hz[0] && odr_hz < from_hz[code - 1u]) {
        code++;
    }
    return code;
}

static int burst(gc_sensor_t *imu, gc_sample_t *sample) {
    uint8_t data[14];
    const int error = gc_sensor_read_regs(imu, GC_MPU6050_ACCEL_XOUT_H, data, sizeof data);
    if (error != GC_OK) {
        return error;
    }
    gc_sensor_words_high_first(data, sample->acc);
    gc_sensor_words_high_first(data + 8, sample->gyro);
    sample->temp = gc_sensor_word(data[6], data[7]);
    imu->data_wait = false;
    return GC_OK;
}

static int identify(gc_sensor_t *imu) {
    return gc_sensor_check_id(imu, 0, imu->part->id_reg, imu->part->id);
}

static int reset(gc_sensor_t *imu) {
    const int error = gc_sensor_write_reg(imu, GC_MPU6050_PWR_MGMT_1, GC_MPU6050_RESET);
    return error != GC_OK ? error
                          : gc_sensor_wait_for_bits(imu, GC_MPU6050_PWR_MGMT_1, GC_MPU6050_RESET, 0, POLL_US,
                                                    GC_MPU6050_RESET_TIMEOUT_US);
}

/* The part starts asleep, by its own oscillator, which is off by more than the gyroscope's. */
static int wake(gc_sensor_t *imu) {
    int error = gc_sensor_write_reg(imu, GC_MPU6050_PWR_MGMT_1, 0);
    if (error == GC_OK) {
        gc_sensor_wait_us(imu, GC_MPU6050_WAKE_US + GC_MPU6050_GYRO_ON_US);
        error = gc_sensor_write_reg(imu, GC_MPU6050_PWR_MGMT_1, GC_MPU6050_CLOCK_GYRO);
    }
    return error;
}

static int configure(gc_sensor_t *imu) {
    const uint8_t filter = filter_code(imu->odr_hz);
    const uint8_t low_pass = imu->low_pass > 0u ? (uint8_t)imu->low_pass : filter; /* DLPF_CFG */
    imu->written[0] = imu->odr->code;
    imu->written[1] = low_pass;
    imu->written[2] = imu->range->code;
    imu->written[3] = imu->accel->code;
    imu->written[4] = filter;
    int error = GC_OK;
    for (uint8_t i = 0; i < imu->part->watched && error == GC_OK; i++) {
        error = gc_sensor_write_reg(imu, (uint8_t)(GC_MPU6050_SMPLRT_DIV + i), imu->written[i]);
    }
    return error == GC_OK ? gc_sensor_check_config(imu, GC_E_CONFIG_REFUSED) : error;
}

static int set_up(gc_sensor_t *imu) {
    gc_sample_t first;
    imu->period_us = 1e6 / imu->odr_hz;
    gc_sensor_wait_us(imu, GC_MPU6050_BOOT_US);
    int error = identify(imu);
    if (error == GC_OK) {
        error = reset(imu);
    }
    if (error == GC_OK) {
        error = wake(imu);
    }
    if (error == GC_OK) {
        error = gc_sensor_leave_i2c(imu);
    }
    if (error == GC_OK) {
        error = configure(imu);
    }
    if (error == GC_OK) {
        error = gc_sensor_write_reg(imu, GC_MPU6050_INT_PIN_CFG, GC_MPU6050_LATCH_INT);
    }
    if (error == GC_OK) { /* the flag of INT_STATUS is that of the interrupt */
        error = gc_sensor_write_reg(imu, GC_MPU6050_INT_ENABLE, GC_MPU6050_DATA_READY);
    }
    if (error == GC_OK) {
        gc_sensor_wait_us(imu, GC_MPU6050_FILTER_US);
        error = burst(imu, &first);
    }
    return error;
}

static int ready(gc_sensor_t *imu) {
    return gc_sensor_ready_once(imu, GC_MPU6050_INT_STATUS, GC_MPU6050_DATA_READY);
}

/* ---- self-test ---- */

/* Of the MPU-6050: within 14 % of the change at the factory, or 10 to 105 dps where its code is missing. */
static void limit_by_trim(gc_self_test_t *result, const uint8_t trim[3]) {
    for (size_t i = 0; i < 3u; i++) {
        const unsigned code = trim[i] & 0x1Fu;
        double factory_dps = 25.0;
        for (unsigned k = 1; k < code; k++) {
            factory_dps *= 1.046;
        }
        result->least_dps[i] = code > 0u ? 0.86 * factory_dps : 10.0;
        result->most_dps[i] = code > 0u ? 1.14 * factory_dps : 105.0;
    }
}

static const uint8_t moving[][2] = {{GC_MPU6050_GYRO_CONFIG, GC_MPU6050_GYRO_TEST}};

static int test_by_trim(gc_sensor_t *imu, gc_self_test_t *result) {
    static const uint8_t still[][2] = {{GC_MPU6050_SMPLRT_DIV, 0}, {GC_MPU6050_CONFIG, 1}, {GC_MPU6050_GYRO_CONFIG, 0}};
    static const gc_moving_test_t test = {
        .still = still, .stills = sizeof still / sizeof still[0], .moving = moving, .movings = 1,
        .settle_us = GC_MPU6050_TEST_US, .samples = 50, .lsb_dps = 1.0 / 131.0};
    uint8_t trim[3];
    const int error = gc_sensor_read_regs(imu, GC_MPU6050_TRIM, trim, sizeof trim);
    if (error != GC_OK) {
        return error;
    }
    limit_by_trim(result, trim);
    return gc_self_test_by_change(imu, &test, result);
}

static int test_by_code(gc_sensor_t *imu, gc_self_test_t *result) {
    static const uint8_t still[][2] = {{GC_MPU6050_SMPLRT_DIV, 0}, {GC_MPU6050_CONFIG, 2}, {GC_MPU6050_GYRO_CONFIG, 0}};
    static const gc_moving_test_t test = {
        .still = still, .stills = sizeof still / sizeof still[0], .moving = moving, .movings = 1,
        .settle_us = GC_MPU6050_TEST_US, .samples = 200, .lsb_dps = 1.0 / 131.0};
    uint8_t code[3];
    const int error = gc_sensor_read_regs(imu, GC_MPU6500_SELF_TEST_X_GYRO, code, sizeof code);
    if (error != GC_OK) {
        return error;
    }
    gc_self_test_limit_by_code(result, code);
    return gc_self_test_by_change(imu, &test, result);
}

#define ALIKE                                                                                                            \
    .address = {GC_MPU6050_ADDRESS, GC_MPU6050_ADDRESS_HIGH}, .id_reg = GC_MPU6050_WHO_AM_I, .lsb_g = 1.0 / 16384.0, .odr = odrs,                       \
    .odrs = sizeof odrs / sizeof odrs[0], .polled_from_hz = 500.0, .range = ranges,                                      \
    .ranges = sizeof ranges / sizeof ranges[0], .accel = accels, .accels = sizeof accels / sizeof accels[0],             \
    .low_passes = 6, .watched_reg = GC_MPU6050_SMPLRT_DIV, .identify = identify,                                         \
    .set_up = set_up, .ready = ready, .read = burst
#define WITH_ACCEL_FILTER                                                                                                \
    .spi = {&spi}, .traits = GC_MPU_HAS_ACCEL_FILTER, .watched = CONFIG_REGS + 1u, .lsb_c = 1.0 / 333.87, .zero_c = 21.0,               \
    .self_test = test_by_code,                                                                                           \
    .noise_dps = 0.14 /* 0.01 dps/sqrt(Hz) within 188 Hz */

const gc_part_t gc_mpu6050 = {
    .name = "MPU-6050", .id = GC_MPU6050_ID, .watched = CONFIG_REGS, .lsb_c = 1.0 / 340.0, .zero_c = 36.53,
    ALIKE, .self_test = test_by_trim, .noise_dps = 0.069, /* 0.005 dps/sqrt(Hz) within 188 Hz */
};
const gc_part_t gc_mpu6500 = {.name = "MPU-6500", .id = GC_MPU6500_ID, WITH_ACCEL_FILTER, ALIKE};
const gc_part_t gc_mpu9250 = {.name = "MPU-9250", .id = GC_MPU9250_ID, WITH_ACCEL_FILTER, ALIKE};
const gc_part_t gc_mpu9255 = {.name = "MPU-9255", .id = GC_MPU9255_ID, WITH_ACCEL_FILTER, ALIKE};
