#include "gc_bmi088.h"

#include "gc_error.h"

enum { RANGE, BANDWIDTH, FIFO_MODE, ACC_CONF, ACC_RANGE, ACC_POWER, CONFIG_REGS }; /* the watched ones */

#define POLL_US 1000u
#define FRAME_BYTES 6u
#define BURST_FRAMES 5u /* some boards' I2C buffers hold 32 bytes */
#define MOST_FRAMES 10u /* a single sample is the newest of so many; of more, the readings after them */

/* The widest filter of each rate: 32, 64, 47, 116 and 230 Hz. */
static const gc_odr_t odrs[] = {{100.0, 7}, {200.0, 6}, {400.0, 3}, {1000.0, 2}, {2000.0, 1}};
static const gc_spi_t gyr_spi = {.most_hz = 10000000, .mode = 0};
static const gc_spi_t acc_spi = {.most_hz = 10000000, .mode = 0, .dummies = 1, .starts_as_i2c = true};
static const gc_range_t ranges[] = {{125.0, 125.0 / 32768.0, 4},
                                    {250.0, 250.0 / 32768.0, 3},
                                    {500.0, 500.0 / 32768.0, 2},
                                    {1000.0, 1000.0 / 32768.0, 1},
                                    {2000.0, 2000.0 / 32768.0, 0}};

static const gc_accel_t accels[] = {{3.0, 0}, {6.0, 1}, {12.0, 2}, {24.0, 3}};

/* The other filter that a rate has: 12 and 23 Hz, and 532 Hz. */
static uint8_t other_code(double odr_hz) {
    return odr_hz == 100.0 ? 5 : odr_hz == 200.0 ? 4 : 0;
}

static unsigned low_passes_at(double odr_hz) {
    return odr_hz == 400.0 || odr_hz == 1000.0 ? 0u : 1u;
}

static uint8_t acc_code(double odr_hz) {
    return odr_hz <= 100.0 ? 8 : odr_hz <= 200.0 ? 9 : odr_hz <= 400.0 ? 10 : odr_hz <= 1000.0 ? 11 : 12;
}

/* ---- start-up ---- */

/* Both dies must answer; the accelerometer's address is chosen by a pin of its own. */
static int identify(gc_sensor_t *imu) {
    int error = gc_sensor_check_id(imu, 0, imu->part->id_reg, imu->part->id);
    if (error != GC_OK) {
        return error;
    }
    imu->other_address = (uint8_t)(GC_BMI088_ACC_ADDRESS | (imu->address & 1u));
    error = gc_sensor_check_id(imu, 1, GC_BMI088_ACC_CHIP_ID, GC_BMI088_ACC_ID);
    if (error != GC_OK) {
        imu->other_address ^= 1u;
        error = gc_sensor_check_id(imu, 1, GC_BMI088_ACC_CHIP_ID, GC_BMI088_ACC_ID);
    }
    return error;
}

/* A die does not answer while it resets. */
static int reset(gc_sensor_t *imu) {
    const gc_port_t *port = imu->port;
    int error = gc_sensor_write_other(imu, GC_BMI088_ACC_SOFTRESET, GC_BMI088_RESET);
    if (error == GC_OK) {
        error = gc_sensor_write_reg(imu, GC_BMI088_SOFTRESET, GC_BMI088_RESET);
    }
    const uint64_t start = port->now_us(port->context);
    do {
        if (error == GC_OK && port->now_us(port->context) - start > GC_BMI088_RESET_TIMEOUT_US) {
            return GC_E_RESET_TIMEOUT;
        }
        gc_sensor_wait_us(imu, POLL_US);
    } while (error == GC_OK && identify(imu) != GC_OK);
    return error;
}

/* The accelerometer starts in suspend. */
static int wake_accelerometer(gc_sensor_t *imu) {
    int error = gc_sensor_write_other(imu, GC_BMI088_ACC_PWR_CONF, 0);
    gc_sensor_wait_us(imu, GC_BMI088_ACC_POWER_US);
    if (error == GC_OK) {
        error = gc_sensor_write_other(imu, GC_BMI088_ACC_PWR_CTRL, GC_BMI088_ACC_ON);
    }
    gc_sensor_wait_us(imu, GC_BMI088_ACC_POWER_US);
    return error;
}

static int read_watched(gc_sensor_t *imu, uint8_t *found) {
    int error = gc_sensor_read_regs(imu, GC_BMI088_RANGE, found, 2);
    if (error == GC_OK) {
        error = gc_sensor_read_regs(imu, GC_BMI088_FIFO_CONFIG_1, found + FIFO_MODE, 1);
    }
    if (error == GC_OK) {
        error = gc_sensor_read_other(imu, GC_BMI088_ACC_CONF, found + ACC_CONF, 2);
    }
    return error == GC_OK ? gc_sensor_read_other(imu, GC_BMI088_ACC_PWR_CTRL, found + ACC_POWER, 1) : error;
}

static int configure(gc_sensor_t *imu) {
    imu->written[RANGE] = imu->range->code;
    imu->written[BANDWIDTH] = (uint8_t)(GC_BMI088_BANDWIDTH_READS | (imu->low_pass > 0u ? other_code(imu->odr_hz) : imu->odr->code));
    imu->written[FIFO_MODE] = GC_BMI088_FIFO_STREAM;
    imu->written[ACC_CONF] = (uint8_t)(GC_BMI088_ACC_MODE | acc_code(imu->odr_hz));
    imu->written[ACC_RANGE] = imu->accel->code;
    imu->written[ACC_POWER] = GC_BMI088_ACC_ON;
    const uint8_t steps[][2] = {
        {GC_BMI088_RANGE, imu->written[RANGE]},
        {GC_BMI088_BANDWIDTH, imu->written[BANDWIDTH]},
        {GC_BMI088_INT3_IO_CONF, GC_BMI088_INT3_ACTIVE_HIGH},
        {GC_BMI088_INT3_IO_MAP, GC_BMI088_MAP_DATA},
        {GC_BMI088_INT_CTRL, GC_BMI088_INT_DATA},
        {GC_BMI088_FIFO_CONFIG_0, 0},
        {GC_BMI088_FIFO_CONFIG_1, imu->written[FIFO_MODE]},
    };
    int error = gc_sensor_write_other(imu, GC_BMI088_ACC_CONF, imu->written[ACC_CONF]);
    if (error == GC_OK) {
        error = gc_sensor_write_other(imu, GC_BMI088_ACC_CONF + 1, imu->written[ACC_RANGE]);
    }
    if (error == GC_OK) {
        error = gc_sensor_write_steps(imu, steps, sizeof steps / sizeof steps[0]);
    }
    return error == GC_OK ? gc_sensor_check_config(imu, GC_E_CONFIG_REFUSED) : error;
}

/* Writing its mode empties it. */
static int empty_fifo(gc_sensor_t *imu) {
    return gc_sensor_write_reg(imu, GC_BMI088_FIFO_CONFIG_1, GC_BMI088_FIFO_STREAM);
}

static int set_up(gc_sensor_t *imu) {
    imu->period_us = 1e6 / imu->odr_hz;
    imu->temp_us = 0;
    gc_sensor_wait_us(imu, GC_BMI088_BOOT_US);
    int error = identify(imu);
    if (error == GC_OK) {
        error = reset(imu);
    }
    if (error == GC_OK) {
        error = wake_accelerometer(imu);
    }
    if (error == GC_OK) {
        error = configure(imu);
    }
    if (error == GC_OK) {
        gc_sensor_wait_us(imu, GC_BMI088_TURN_ON_US);
        error = empty_fifo(imu);
    }
    return error;
}

/* ---- readings ---- */

static int read_level(gc_sensor_t *imu, unsigned *frames, bool *overrun) {
    uint8_t status = 0;
    const int error = gc_sensor_read_regs(imu, GC_BMI088_FIFO_STATUS, &status, 1);
    *frames = status & GC_BMI088_FIFO_LEVEL;
    *overrun = (status & GC_BMI088_FIFO_OVERRUN) != 0u;
    return error;
}

/* Eleven bits of an eighth of a degree. */
static int read_temperature(gc_sensor_t *imu) {
    const uint64_t now_us = imu->port->now_us(imu->port->context);
    uint8_t data[2];
    if (imu->temp_us != 0u && now_us - imu->temp_us < GC_BMI088_TEMP_EVERY_US) {
        return GC_OK;
    }
    const int error = gc_sensor_read_other(imu, GC_BMI088_ACC_TEMP, data, sizeof data);
    if (error == GC_OK) {
        const int counts = data[0] << 3 | data[1] >> 5;
        imu->partial.temp = (int16_t)(counts > 1023 ? counts - 2048 : counts);
        imu->temp_us = now_us;
    }
    return error;
}

/* What the gyroscope's FIFO does not hold. */
static int read_rest(gc_sensor_t *imu) {
    uint8_t data[FRAME_BYTES];
    const int error = gc_sensor_read_other(imu, GC_BMI088_ACC_X, data, sizeof data);
    if (error != GC_OK) {
        return error;
    }
    gc_sensor_words_low_first(data, imu->partial.acc);
    return read_temperature(imu);
}

static int ready(gc_sensor_t *imu) {
    unsigned frames;
    bool overrun;
    const int error = read_level(imu, &frames, &overrun);
    return error != GC_OK ? error : frames > 0u ? 1 : 0;
}

static int take_frames(gc_sensor_t *imu, unsigned frames, gc_batch_t *batch) {
    uint8_t data[BURST_FRAMES * FRAME_BYTES];
    int error = GC_OK;
    while (error == GC_OK && frames > 0u && batch->n < GC_BATCH_MAX) {
        const unsigned room = GC_BATCH_MAX - batch->n;
        const unsigned most = room < BURST_FRAMES ? room : BURST_FRAMES;
        const unsigned n = frames < most ? frames : most;
        error = gc_sensor_read_regs(imu, GC_BMI088_FIFO_DATA, data, n * FRAME_BYTES);
        for (unsigned k = 0; k < n && error == GC_OK; k++) {
            gc_sensor_words_low_first(data + k * FRAME_BYTES, imu->partial.gyro);
            imu->partial.fresh = true;
            batch->sample[batch->n++] = imu->partial;
        }
        frames -= n;
    }
    imu->fifo_broken = error != GC_OK; /* the start of the next frame is unknown */
    batch->left = frames;
    return error;
}

/* The newest frame of those that wait; those before it have been passed over. */
static int read_newest(gc_sensor_t *imu, unsigned frames) {
    uint8_t data[BURST_FRAMES * FRAME_BYTES];
    int error = GC_OK;
    while (error == GC_OK && frames > 0u) {
        const unsigned n = frames < BURST_FRAMES ? frames : BURST_FRAMES;
        error = gc_sensor_read_regs(imu, GC_BMI088_FIFO_DATA, data, n * FRAME_BYTES);
        frames -= n;
        if (error == GC_OK) {
            gc_sensor_words_low_first(data + (n - 1u) * FRAME_BYTES, imu->partial.gyro);
        }
    }
    return error;
}

static int read_now(gc_sensor_t *imu) {
    uint8_t data[FRAME_BYTES];
    int error = empty_fifo(imu);
    if (error == GC_OK) {
        error = gc_sensor_read_regs(imu, GC_BMI088_RATE_X, data, sizeof data);
    }
    if (error == GC_OK) {
        gc_sensor_words_low_first(data, imu->partial.gyro);
    }
    return error;
}

static int read_one(gc_sensor_t *imu, gc_sample_t *sample) {
    const bool fresh = sample->fresh;
    unsigned frames;
    bool overrun;
    int error = read_level(imu, &frames, &overrun);
    if (error == GC_OK) {
        error = overrun || frames > MOST_FRAMES ? read_now(imu) : read_newest(imu, frames);
    }
    if (error == GC_OK) {
        error = read_rest(imu);
    }
    if (error != GC_OK) {
        (void)empty_fifo(imu); /* a frame may have been read in part */
    }
    *sample = imu->partial;
    sample->fresh = fresh;
    return error;
}

static int fifo_restart(gc_sensor_t *imu) {
    const uint8_t steps[][2] = {
        {GC_BMI088_FIFO_CONFIG_0, (uint8_t)imu->batch},
        {GC_BMI088_FIFO_WM_EN, GC_BMI088_WM_ON},
        {GC_BMI088_INT3_IO_MAP, GC_BMI088_MAP_FIFO},
        {GC_BMI088_INT_CTRL, GC_BMI088_INT_FIFO},
        {GC_BMI088_FIFO_CONFIG_1, GC_BMI088_FIFO_STREAM},
    };
    const int error = gc_sensor_write_steps(imu, steps, sizeof steps / sizeof steps[0]);
    imu->fifo_broken = error != GC_OK;
    imu->fresh_us = imu->port->now_us(imu->port->context);
    return error;
}

static int fifo_read(gc_sensor_t *imu, gc_batch_t *batch) {
    unsigned frames;
    batch->gap = imu->fifo_broken;
    int error = imu->fifo_broken ? fifo_restart(imu) : GC_OK;
    batch->t_us = imu->port->now_us(imu->port->context);
    if (error == GC_OK) {
        error = read_level(imu, &frames, &batch->overrun);
    }
    if (error != GC_OK) {
        return error;
    }
    batch->until_us = imu->port->now_us(imu->port->context);
    batch->gap = batch->gap || batch->overrun;
    error = frames > 0u ? read_rest(imu) : GC_OK;
    if (error == GC_OK && frames > 0u) {
        imu->fresh_us = batch->until_us;
        error = take_frames(imu, frames, batch);
    }
    if (error == GC_OK && batch->overrun) {
        error = empty_fifo(imu); /* the flag stays until then */
        batch->left = 0;
    }
    return error;
}

/* The gyroscope tells no sizes. */
static int self_test(gc_sensor_t *imu, gc_self_test_t *result) {
    const uint64_t start = imu->port->now_us(imu->port->context);
    uint8_t state = 0;
    int error = gc_sensor_write_reg(imu, GC_BMI088_SELF_TEST, GC_BMI088_TEST_BEGIN);
    while (error == GC_OK && (state & GC_BMI088_TEST_READY) == 0u) {
        if (imu->port->now_us(imu->port->context) - start > GC_BMI088_TEST_TIMEOUT_US) {
            return GC_E_STALE;
        }
        gc_sensor_wait_us(imu, POLL_US);
        error = gc_sensor_read_regs(imu, GC_BMI088_SELF_TEST, &state, 1);
    }
    result->passed = error == GC_OK && (state & GC_BMI088_TEST_FAILED) == 0u;
    return error;
}

const gc_part_t gc_bmi088 = {
    .name = "BMI088", .id_reg = GC_BMI088_CHIP_ID, .id = GC_BMI088_ID,
    .address = {GC_BMI088_ADDRESS, GC_BMI088_ADDRESS_HIGH}, .spi = {&gyr_spi, &acc_spi},
    .lsb_g = 3.0 / 32768.0, .lsb_c = 0.125, .zero_c = 23.0,
    .noise_dps = 0.12, /* 0.014 dps/sqrt(Hz) within 47 Hz, of first order */
    .odr = odrs, .odrs = sizeof odrs / sizeof odrs[0], .polled_from_hz = 400.0,
    .range = ranges, .ranges = sizeof ranges / sizeof ranges[0],
    .accel = accels, .accels = sizeof accels / sizeof accels[0], .low_passes = 1, .low_passes_at = low_passes_at,
    .watched = CONFIG_REGS, .read_watched = read_watched,
    .batch_max = 64, /* of 100 frames: a quarter of the FIFO is left for delays */
    .identify = identify, .set_up = set_up, .ready = ready, .read = read_one,
    .fifo_begin = fifo_restart, .fifo_read = fifo_read, .self_test = self_test,
};
