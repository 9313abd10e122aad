#include "gc_bmi270.h"

#include "gc_error.h"

#define CONFIG_REGS 4u /* ACC_CONF, ACC_RANGE, GYR_CONF, GYR_RANGE */
#define CHUNK_BYTES GC_WRITE_MAX /* of the file in one transfer */
#define POLL_US 1000u
#define FRAME_BYTES 12u
#define BURST_FRAMES 10u /* boards' I2C buffers hold 128 bytes */

static const gc_odr_t odrs[] = {{25.0, 6}, {50.0, 7}, {100.0, 8}, {200.0, 9}, {400.0, 10}, {800.0, 11}, {1600.0, 12}};
static const gc_spi_t spi = {.most_hz = 10000000, .mode = 0, .dummies = 1, .starts_as_i2c = true};
static const gc_range_t ranges[] = {{125.0, 125.0 / 32768.0, 4},
                                    {250.0, 250.0 / 32768.0, 3},
                                    {500.0, 500.0 / 32768.0, 2},
                                    {1000.0, 1000.0 / 32768.0, 1},
                                    {2000.0, 2000.0 / 32768.0, 0}};

static const gc_accel_t accels[] = {{2.0, 0}, {4.0, 1}, {8.0, 2}, {16.0, 3}};
/* GYR_CONF by low-pass: normal, and oversampled by two and four. */
static const uint8_t gyr_modes[] = {GC_BMI270_GYR_MODE, GC_BMI270_GYR_OSR2, GC_BMI270_GYR_OSR4};

/* To the temperature; the interrupt's state in between is read too, which releases the latched pin. */
static int burst(gc_sensor_t *imu, gc_sample_t *sample) {
    uint8_t data[24];
    const int error = gc_sensor_read_regs(imu, GC_BMI270_ACC_X, data, sizeof data);
    if (error != GC_OK) {
        return error;
    }
    gc_sensor_words_low_first(data, sample->acc);
    gc_sensor_words_low_first(data + 6, sample->gyro);
    sample->temp = gc_sensor_word(data[23], data[22]);
    return GC_OK;
}

static int identify(gc_sensor_t *imu) {
    return gc_sensor_check_id(imu, 0, imu->part->id_reg, imu->part->id);
}

/* After a reset the part is in its saving mode again, which is how the end of one shows. */
static int reset(gc_sensor_t *imu) {
    const gc_port_t *port = imu->port;
    int error = gc_sensor_write_reg(imu, GC_BMI270_CMD, GC_BMI270_SOFT_RESET);
    const uint64_t start = port->now_us(port->context);
    gc_sensor_wait_us(imu, GC_BMI270_RESET_US);
    uint8_t id = 0;
    while (error == GC_OK && (identify(imu) != GC_OK || gc_sensor_read_regs(imu, GC_BMI270_PWR_CONF, &id, 1) != GC_OK || (id & 1u) == 0u)) {
        if (port->now_us(port->context) - start > GC_BMI270_RESET_TIMEOUT_US) {
            return GC_E_RESET_TIMEOUT;
        }
        gc_sensor_wait_us(imu, POLL_US);
    }
    return error;
}

static int write_chunk(gc_sensor_t *imu, const uint8_t *file, size_t at, size_t n) {
    const size_t word = at / 2u;
    const uint8_t where[] = {(uint8_t)(word & 0x0Fu), (uint8_t)(word >> 4)};
    const int error = gc_sensor_write_regs(imu, GC_BMI270_INIT_ADDR_0, where, sizeof where);
    return error == GC_OK ? gc_sensor_write_regs(imu, GC_BMI270_INIT_DATA, file + at, n) : error;
}

static int wait_for_init(gc_sensor_t *imu) {
    const uint64_t start = imu->port->now_us(imu->port->context);
    uint8_t status = 0;
    int error = GC_OK;
    while (error == GC_OK && (status & GC_BMI270_INIT_MASK) != GC_BMI270_INIT_OK) {
        if (imu->port->now_us(imu->port->context) - start > GC_BMI270_INIT_TIMEOUT_US) {
            return GC_E_PART_FILE_REFUSED;
        }
        gc_sensor_wait_us(imu, POLL_US);
        error = gc_sensor_read_regs(imu, GC_BMI270_INTERNAL_STATUS, &status, 1);
    }
    return error;
}

static int upload(gc_sensor_t *imu, const uint8_t *file, size_t n) {
    int error = gc_sensor_write_reg(imu, GC_BMI270_PWR_CONF, 0);
    gc_sensor_wait_us(imu, GC_BMI270_WAKE_US);
    if (error == GC_OK) {
        error = gc_sensor_write_reg(imu, GC_BMI270_INIT_CTRL, 0);
    }
    for (size_t at = 0; at < n && error == GC_OK; at += CHUNK_BYTES) {
        error = write_chunk(imu, file, at, n - at < CHUNK_BYTES ? n - at : CHUNK_BYTES);
    }
    if (error == GC_OK) {
        error = gc_sensor_write_reg(imu, GC_BMI270_INIT_CTRL, 1);
    }
    return error == GC_OK ? wait_for_init(imu) : error;
}

static int configure(gc_sensor_t *imu) {
    imu->written[0] = (uint8_t)(GC_BMI270_ACC_MODE | imu->odr->code);
    imu->written[1] = imu->accel->code;
    imu->written[2] = (uint8_t)(gyr_modes[imu->low_pass] | imu->odr->code);
    imu->written[3] = imu->range->code;
    const uint8_t steps[][2] = {
        {GC_BMI270_ACC_CONF, imu->written[0]},
        {GC_BMI270_ACC_CONF + 1, imu->written[1]},
        {GC_BMI270_ACC_CONF + 2, imu->written[2]},
        {GC_BMI270_ACC_CONF + 3, imu->written[3]},
        {GC_BMI270_INT1_IO_CTRL, GC_BMI270_INT_ACTIVE_HIGH},
        {GC_BMI270_INT_LATCH, 1},
        {GC_BMI270_INT_MAP_DATA, GC_BMI270_MAP_DRDY},
        {GC_BMI270_PWR_CTRL, GC_BMI270_ALL_ON},
    };
    const int error = gc_sensor_write_steps(imu, steps, sizeof steps / sizeof steps[0]);
    return error == GC_OK ? gc_sensor_check_config(imu, GC_E_CONFIG_REFUSED) : error;
}

static int set_up(gc_sensor_t *imu) {
    const gc_port_t *port = imu->port;
    size_t n = 0;
    const uint8_t *file = port->part_file != NULL ? port->part_file(port->context, imu->part->name, &n) : NULL;
    imu->period_us = 1e6 / imu->odr_hz;
    gc_sensor_wait_us(imu, GC_BMI270_BOOT_US);
    int error = identify(imu);
    if (error == GC_OK) {
        error = file != NULL && n > 0u && n % 2u == 0u ? reset(imu) : GC_E_PART_FILE;
    }
    if (error == GC_OK) {
        error = upload(imu, file, n);
    }
    if (error == GC_OK) {
        error = configure(imu);
    }
    if (error == GC_OK) {
        gc_sensor_wait_us(imu, GC_BMI270_TURN_ON_US);
        error = burst(imu, &imu->partial);
    }
    return error;
}

static int ready(gc_sensor_t *imu) {
    uint8_t status = 0;
    const int error = gc_sensor_read_regs(imu, GC_BMI270_STATUS, &status, 1);
    return error != GC_OK ? error : (status & GC_BMI270_DRDY_GYR) != 0u ? 1 : 0;
}

/* ---- FIFO ---- */

static int fifo_restart(gc_sensor_t *imu) {
    const unsigned bytes = FRAME_BYTES * imu->batch;
    const uint8_t steps[][2] = {
        {GC_BMI270_FIFO_WTM_0, (uint8_t)(bytes & 0xFFu)},
        {GC_BMI270_FIFO_WTM_0 + 1, (uint8_t)(bytes >> 8)},
        {GC_BMI270_FIFO_CONFIG_0, 0}, /* the newest overwrite the oldest */
        {GC_BMI270_FIFO_CONFIG_0 + 1, GC_BMI270_FIFO_ACC_GYR},
        {GC_BMI270_INT_MAP_DATA, GC_BMI270_MAP_WATERMARK},
        {GC_BMI270_CMD, GC_BMI270_FIFO_FLUSH},
    };
    uint8_t kept = 0;
    int error = gc_sensor_write_steps(imu, steps, sizeof steps / sizeof steps[0]);
    if (error == GC_OK) {
        error = gc_sensor_read_regs(imu, GC_BMI270_FIFO_CONFIG_0 + 1, &kept, 1);
    }
    if (error == GC_OK && kept != GC_BMI270_FIFO_ACC_GYR) {
        error = GC_E_CONFIG_REFUSED;
    }
    imu->fifo_broken = error != GC_OK;
    imu->fresh_us = imu->port->now_us(imu->port->context);
    return error;
}

static int take_frames(gc_sensor_t *imu, unsigned frames, gc_batch_t *batch) {
    uint8_t data[BURST_FRAMES * FRAME_BYTES];
    int error = GC_OK;
    while (error == GC_OK && frames > 0u && batch->n < GC_BATCH_MAX) {
        const unsigned room = GC_BATCH_MAX - batch->n;
        const unsigned most = room < BURST_FRAMES ? room : BURST_FRAMES;
        const unsigned n = frames < most ? frames : most;
        error = gc_sensor_read_regs(imu, GC_BMI270_FIFO_DATA, data, n * FRAME_BYTES);
        for (unsigned k = 0; k < n && error == GC_OK; k++) {
            gc_sample_t *sample = &batch->sample[batch->n++];
            gc_sensor_words_low_first(data + k * FRAME_BYTES, sample->gyro);
            gc_sensor_words_low_first(data + k * FRAME_BYTES + 6u, sample->acc);
            sample->temp = imu->partial.temp;
            sample->fresh = true;
        }
        frames -= n;
    }
    imu->fifo_broken = error != GC_OK; /* the start of the next frame is unknown */
    batch->left = frames;
    return error;
}

/* One transfer reads whether it was full, the temperature and its level. */
static int fifo_read(gc_sensor_t *imu, gc_batch_t *batch) {
    uint8_t data[9];
    batch->gap = imu->fifo_broken;
    int error = imu->fifo_broken ? fifo_restart(imu) : GC_OK;
    batch->t_us = imu->port->now_us(imu->port->context);
    if (error == GC_OK) {
        error = gc_sensor_read_regs(imu, GC_BMI270_INT_STATUS_1, data, sizeof data);
    }
    if (error != GC_OK) {
        return error;
    }
    batch->until_us = imu->port->now_us(imu->port->context);
    batch->overrun = (data[0] & GC_BMI270_FIFO_FULL) != 0u;
    batch->gap = batch->gap || batch->overrun;
    imu->partial.temp = gc_sensor_word(data[6], data[5]);
    const unsigned frames = ((unsigned)(data[8] & 0x3F) << 8 | data[7]) / FRAME_BYTES;
    if (frames == 0u) {
        return GC_OK;
    }
    imu->fresh_us = batch->until_us;
    return take_frames(imu, frames, batch);
}

/* ---- self-test ---- */

static int select_page(gc_sensor_t *imu, uint8_t page) {
    return gc_sensor_write_reg(imu, GC_BMI270_FEAT_PAGE, page);
}

/* One word of a page: no burst (the file's own test needs none), the test of the gyroscope and not its trim, and no abort. */
static int choose_test(gc_sensor_t *imu) {
    static const uint8_t word[2] = {0, 0};
    const int error = select_page(imu, 1);
    return error == GC_OK ? gc_sensor_write_regs(imu, GC_BMI270_G_TRIG_1, word, sizeof word) : error;
}

static int begin_test(gc_sensor_t *imu) {
    const uint8_t steps[][2] = {
        {GC_BMI270_FIFO_CONFIG_0 + 1, 0},
        {GC_BMI270_PWR_CTRL, GC_BMI270_ALL_BUT_GYR},
    };
    int error = gc_sensor_change_bits(imu, GC_BMI270_GYR_CRT_CONF, 0, GC_BMI270_CRT_RUNNING);
    if (error == GC_OK) {
        error = gc_sensor_write_steps(imu, steps, sizeof steps / sizeof steps[0]);
    }
    gc_sensor_wait_us(imu, GC_BMI270_GYR_OFF_US);
    if (error == GC_OK) {
        error = choose_test(imu);
    }
    return error == GC_OK ? gc_sensor_write_reg(imu, GC_BMI270_CMD, GC_BMI270_G_TRIGGER) : error;
}

/* The part tells no sizes. It gives up when it is moved. */
static int self_test(gc_sensor_t *imu, gc_self_test_t *result) {
    uint8_t status = 0, axes = 0;
    int error = begin_test(imu);
    if (error == GC_OK) {
        error = gc_sensor_wait_for_bits(imu, GC_BMI270_GYR_CRT_CONF, GC_BMI270_CRT_RUNNING, 0, POLL_US, GC_BMI270_TEST_TIMEOUT_US);
        error = error == GC_E_RESET_TIMEOUT ? GC_E_STALE : error;
    }
    if (error == GC_OK) {
        error = select_page(imu, 0);
    }
    if (error == GC_OK) {
        error = gc_sensor_read_regs(imu, GC_BMI270_GYR_GAIN_STATUS, &status, 1);
    }
    if (error == GC_OK) {
        error = gc_sensor_read_regs(imu, GC_BMI270_GYR_SELF_TEST_AXES, &axes, 1);
    }
    result->passed = error == GC_OK && (status & GC_BMI270_G_TRIG_STATUS) == 0u && (axes & GC_BMI270_AXES_OK) == GC_BMI270_AXES_OK;
    return error;
}

const gc_part_t gc_bmi270 = {
    .name = "BMI270", .id_reg = GC_BMI270_CHIP_ID, .id = GC_BMI270_ID,
    .address = {GC_BMI270_ADDRESS, GC_BMI270_ADDRESS_HIGH}, .spi = {&spi},
    .lsb_g = 2.0 / 32768.0, .lsb_c = 1.0 / 512.0, .zero_c = 23.0,
    .noise_dps = 0.09, /* 0.007 dps/sqrt(Hz) within the filter of 400 Hz */
    .odr = odrs, .odrs = sizeof odrs / sizeof odrs[0], .polled_from_hz = 400.0,
    .range = ranges, .ranges = sizeof ranges / sizeof ranges[0],
    .accel = accels, .accels = sizeof accels / sizeof accels[0], .low_passes = 2,
    .watched_reg = GC_BMI270_ACC_CONF, .watched = CONFIG_REGS,
    .batch_max = 128, /* of 170 frames: a quarter of the FIFO is left for delays */
    .identify = identify, .set_up = set_up, .ready = ready, .read = burst,
    .fifo_begin = fifo_restart, .fifo_read = fifo_read, .self_test = self_test,
};
