#include "gc_lsm6dsv.h"

#include "gc_error.h"
#include "gc_self_test.h"
#include "gc_tagged_fifo.h"

enum { CTRL1, CTRL2, CTRL3, CTRL4, CTRL5, CTRL6, CTRL7, CTRL8, CONFIG_REGS }; /* the watched ones */
#define RESET_LOOK_US 100u
#define TEST_CODE_240_HZ 7u
#define TEST_CODE_2000_DPS 4u

static const gc_odr_t odrs[] = {{7.5, 2}, {15.0, 3}, {30.0, 4}, {60.0, 5}, {120.0, 6}, {240.0, 7}, {480.0, 8}, {960.0, 9}, {1920.0, 10}, {3840.0, 11}};
static const gc_spi_t spi = {.most_hz = 10000000, .mode = 3, .i2c_off_reg = GC_LSM6DSV_IF_CFG, .i2c_off = GC_LSM6DSV_I2C_I3C_DISABLE};
static const gc_range_t ranges[] = {{125.0, 0.004375, 0x00}, {250.0, 0.00875, 0x01}, {500.0, 0.0175, 0x02},
                                    {1000.0, 0.035, 0x03},   {2000.0, 0.070, 0x04},  {4000.0, 0.140, 0x0C}};
static const gc_accel_t accels[] = {{2.0, 0}, {4.0, 1}, {8.0, 2}, {16.0, 3}};
static const gc_tagged_fifo_t fifo = {
    .status_reg = GC_LSM6DSV_FIFO_STATUS1, .level_bits = 1, .slow_temp_hz = 15.0, .temp_hz = 60.0, .acc_code = 6, .acc_hz = 120.0};

static int burst(gc_sensor_t *imu, gc_sample_t *sample) {
    uint8_t data[14];
    const int error = gc_sensor_read_regs(imu, GC_LSM6DSV_OUT_TEMP_L, data, sizeof data);
    if (error != GC_OK) {
        return error;
    }
    sample->temp = gc_sensor_word(data[1], data[0]);
    gc_sensor_words_low_first(data + 2, sample->gyro);
    gc_sensor_words_low_first(data + 8, sample->acc);
    return GC_OK;
}

/* Another program may have left another bank selected. */
static int identify(gc_sensor_t *imu) {
    const int error = gc_sensor_write_reg(imu, GC_LSM6DSV_FUNC_CFG_ACCESS, 0);
    return error == GC_OK ? gc_sensor_check_id(imu, 0, imu->part->id_reg, imu->part->id) : error;
}

static int reset(gc_sensor_t *imu) {
    static const uint8_t steps[][2] = {{GC_LSM6DSV_INT1_CTRL, 0},
                                       {GC_LSM6DSV_CTRL1, 0},
                                       {GC_LSM6DSV_CTRL2, 0},
                                       {GC_LSM6DSV_CTRL3, GC_LSM6DSV_CTRL3_SW_RESET | GC_LSM6DSV_CTRL3_IF_INC}};
    const int error = gc_sensor_write_steps(imu, steps, sizeof steps / sizeof steps[0]);
    return error != GC_OK ? error
                          : gc_sensor_wait_for_bits(imu, GC_LSM6DSV_CTRL3, GC_LSM6DSV_CTRL3_SW_RESET, 0, RESET_LOOK_US,
                                                    GC_LSM6DSV_RESET_TIMEOUT_US);
}

static int read_period(gc_sensor_t *imu) {
    uint8_t fine = 0;
    const int error = gc_sensor_read_regs(imu, GC_LSM6DSV_INTERNAL_FREQ, &fine, 1);
    const int faster = fine < 128u ? fine : fine - 256;
    imu->period_us = 1e6 / (imu->odr_hz * (1.0 + GC_LSM6DSV_FREQ_LSB * faster));
    return error;
}

/* The pin drives what is wired to it only where a port waits for it. */
static int route_int1(gc_sensor_t *imu, uint8_t source) {
    return imu->port->wait_ready_us != NULL ? gc_sensor_write_reg(imu, GC_LSM6DSV_INT1_CTRL, source) : GC_OK;
}

/* BDU comes first, so that no word is read in two halves. */
static int configure(gc_sensor_t *imu) {
    const unsigned bandwidth = imu->low_pass > 0u ? imu->low_pass - 1u : 0u;
    imu->written[CTRL1] = imu->odr->code;
    imu->written[CTRL2] = imu->odr->code;
    imu->written[CTRL3] = GC_LSM6DSV_CTRL3_BDU | GC_LSM6DSV_CTRL3_IF_INC;
    imu->written[CTRL4] = 0;
    imu->written[CTRL5] = 0;
    imu->written[CTRL6] = (uint8_t)(bandwidth << 4 | imu->range->code);
    imu->written[CTRL7] = imu->low_pass > 0u ? GC_LSM6DSV_CTRL7_LPF1_G_EN : 0u;
    imu->written[CTRL8] = imu->accel->code;
    const uint8_t steps[][2] = {{GC_LSM6DSV_CTRL3, imu->written[CTRL3]},
                                {GC_LSM6DSV_CTRL6, imu->written[CTRL6]},
                                {GC_LSM6DSV_CTRL1 + CTRL7, imu->written[CTRL7]},
                                {GC_LSM6DSV_CTRL1 + CTRL8, imu->written[CTRL8]},
                                {GC_LSM6DSV_CTRL1, imu->written[CTRL1]},
                                {GC_LSM6DSV_CTRL2, imu->written[CTRL2]}};
    const int error = gc_sensor_write_steps(imu, steps, sizeof steps / sizeof steps[0]);
    return error == GC_OK ? gc_sensor_check_config(imu, GC_E_CONFIG_REFUSED) : error;
}

static int set_up(gc_sensor_t *imu) {
    gc_sensor_wait_us(imu, GC_LSM6DSV_BOOT_US);
    int error = identify(imu);
    if (error == GC_OK) {
        error = reset(imu);
    }
    if (error == GC_OK) {
        error = gc_sensor_leave_i2c(imu);
    }
    if (error == GC_OK) {
        error = read_period(imu);
    }
    if (error == GC_OK) {
        error = route_int1(imu, GC_LSM6DSV_INT1_DRDY_G);
    }
    if (error == GC_OK) {
        error = configure(imu);
    }
    if (error == GC_OK) {
        gc_sensor_wait_us(imu, GC_LSM6DSV_TURN_ON_US);
        error = burst(imu, &imu->partial); /* the first rates are discarded */
    }
    return error;
}

static int ready(gc_sensor_t *imu) {
    uint8_t status = 0;
    const int error = gc_sensor_read_regs(imu, GC_LSM6DSV_STATUS, &status, 1);
    return error != GC_OK ? error : (status & GC_LSM6DSV_STATUS_GDA) != 0u ? 1 : 0;
}

static int fifo_begin(gc_sensor_t *imu) {
    int error = route_int1(imu, GC_LSM6DSV_INT1_FIFO_TH);
    if (error == GC_OK) {
        error = gc_sensor_write_reg(imu, GC_LSM6DSV_FUNCTIONS_ENABLE, GC_LSM6DSV_TIMESTAMP);
    }
    return error == GC_OK ? gc_tagged_fifo_restart(&fifo, imu) : error;
}

static int fifo_read(gc_sensor_t *imu, gc_batch_t *batch) {
    return gc_tagged_fifo_read(&fifo, imu, batch);
}

static int self_test(gc_sensor_t *imu, gc_self_test_t *result) {
    static const uint8_t still[][2] = {
        {GC_LSM6DSV_INT1_CTRL, 0}, {GC_LSM6DSV_CTRL6, TEST_CODE_2000_DPS}, {GC_LSM6DSV_CTRL2, TEST_CODE_240_HZ}};
    static const uint8_t moving[][2] = {{GC_LSM6DSV_CTRL10, GC_LSM6DSV_CTRL10_GYRO_TEST}};
    static const gc_moving_test_t test = {
        .still = still, .stills = sizeof still / sizeof still[0], .moving = moving, .movings = 1,
        .settle_us = GC_LSM6DSV_TEST_US, .samples = 5, .lsb_dps = 0.070};
    gc_self_test_limit(result, 150.0, 700.0);
    return gc_self_test_by_change(imu, &test, result);
}

const gc_part_t gc_lsm6dsv = {
    .name = "LSM6DSV", .id_reg = GC_LSM6DSV_WHO_AM_I, .id = GC_LSM6DSV_ID,
    .address = {GC_LSM6DSV_ADDRESS, GC_LSM6DSV_ADDRESS_LOW}, .spi = {&spi},
    .lsb_g = 0.000061, .lsb_c = 1.0 / 256.0, .zero_c = 25.0,
    .noise_dps = 0.043, /* 2.8 mdps/sqrt(Hz) within half of 480 Hz */
    .odr = odrs, .odrs = sizeof odrs / sizeof odrs[0], .polled_from_hz = 480.0,
    .range = ranges, .ranges = sizeof ranges / sizeof ranges[0],
    .accel = accels, .accels = sizeof accels / sizeof accels[0], .low_passes = 8,
    .watched_reg = GC_LSM6DSV_CTRL1, .watched = CONFIG_REGS,
    .batch_max = 64, /* of at most three words of 256: a quarter of the FIFO is left for delays */
    .identify = identify, .set_up = set_up, .ready = ready, .read = burst,
    .fifo_begin = fifo_begin, .fifo_read = fifo_read, .self_test = self_test,
};
