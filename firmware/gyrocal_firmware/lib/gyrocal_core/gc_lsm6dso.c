#include "gc_lsm6dso.h"

#include "gc_error.h"

#include <string.h>

#define BURST_WORDS 16u /* of the FIFO: boards' I2C buffers hold 128 bytes */
#define CTRL_REGS 3u /* CTRL1_XL, CTRL2_G, CTRL3_C: the watched ones */

static const gc_odr_t odrs[] = {{12.5, 1}, {26.0, 2}, {52.0, 3}, {104.0, 4}, {208.0, 5}, {416.0, 6}, {833.0, 7}, {1666.0, 8}};
static const gc_range_t ranges[] = {
    {125.0, 0.004375, 0x02}, {250.0, 0.00875, 0x00}, {500.0, 0.0175, 0x04}, {1000.0, 0.035, 0x08}, {2000.0, 0.070, 0x0C},
};

static const gc_range_t dsr_ranges[] = {
    {125.0, 0.004375, 0x02}, {250.0, 0.00875, 0x00}, {500.0, 0.0175, 0x04}, {1000.0, 0.035, 0x08}, {2000.0, 0.070, 0x0C}, {4000.0, 0.140, 0x01},
};

static int16_t word(const uint8_t *data) {
    return (int16_t)((data[1] & 0x80u ? -0x8000 : 0) + ((data[1] & 0x7F) << 8 | data[0]));
}

static void three_words(const uint8_t *data, int16_t out[3]) {
    for (size_t i = 0; i < 3u; i++) {
        out[i] = word(data + 2u * i);
    }
}

static int burst(gc_sensor_t *imu, gc_sample_t *sample) {
    uint8_t data[14];
    const int error = gc_sensor_read_regs(imu, GC_LSM6DSO_OUT_TEMP_L, data, sizeof data);
    if (error != GC_OK) {
        return error;
    }
    sample->temp = word(data);
    three_words(data + 2, sample->gyro);
    three_words(data + 8, sample->acc);
    return GC_OK;
}

/* There is no I3C master, and the interface would take noise for its start condition. */
static int disable_i3c(gc_sensor_t *imu) {
    uint8_t ctrl9 = 0;
    if ((imu->part->traits & GC_LSM6_HAS_I3C) == 0u) {
        return GC_OK;
    }
    const int error = gc_sensor_read_regs(imu, GC_LSM6DSO_CTRL9_XL, &ctrl9, 1);
    return error != GC_OK ? error
                          : gc_sensor_write_reg(imu, GC_LSM6DSO_CTRL9_XL, (uint8_t)(ctrl9 | GC_LSM6DSO_CTRL9_I3C_DISABLE));
}

/* Another program may have left the bank of the embedded functions selected, where WHO_AM_I cannot be read. */
static int identify(gc_sensor_t *imu) {
    uint8_t id = 0;
    int error = gc_sensor_write_reg(imu, GC_LSM6DSO_FUNC_CFG_ACCESS, 0);
    if (error == GC_OK) {
        error = gc_sensor_read_regs(imu, GC_LSM6DSO_WHO_AM_I, &id, 1);
    }
    return error == GC_OK && id != imu->part->id ? GC_E_WRONG_ID : error;
}

/* A part whose INT1 is high at a reset may take its bus for I3C and not answer until power-off. Data that nobody has read keep
   INT1 high, so the pin is released first. The reset itself enables I3C again. */
static int reset(gc_sensor_t *imu) {
    const gc_port_t *port = imu->port;
    int error = gc_sensor_write_reg(imu, GC_LSM6DSO_INT1_CTRL, 0);
    if (error == GC_OK) {
        error = disable_i3c(imu);
    }
    if (error == GC_OK) {
        error = gc_sensor_write_reg(imu, GC_LSM6DSO_CTRL3_C, GC_LSM6DSO_CTRL3_SW_RESET | GC_LSM6DSO_CTRL3_IF_INC);
    }
    const uint64_t start = port->now_us(port->context);
    uint8_t ctrl3 = GC_LSM6DSO_CTRL3_SW_RESET;
    while (error == GC_OK && (ctrl3 & GC_LSM6DSO_CTRL3_SW_RESET)) {
        const uint64_t now = port->now_us(port->context);
        if (now - start > GC_LSM6DSO_RESET_TIMEOUT_US) {
            return GC_E_RESET_TIMEOUT;
        }
        port->wait_until_us(port->context, now + 50u);
        error = gc_sensor_read_regs(imu, GC_LSM6DSO_CTRL3_C, &ctrl3, 1);
    }
    return error == GC_OK ? disable_i3c(imu) : error;
}

static int read_period(gc_sensor_t *imu) {
    uint8_t freq_fine = 0;
    const bool has_it = (imu->part->traits & GC_LSM6_HAS_FREQ_FINE) != 0u;
    const int error = has_it ? gc_sensor_read_regs(imu, GC_LSM6DSO_FREQ_FINE, &freq_fine, 1) : GC_OK;
    const int faster = freq_fine < 128u ? freq_fine : freq_fine - 256;
    const double true_hz = GC_LSM6DSO_ROOT_HZ / (double)(1u << (GC_LSM6DSO_ROOT_CODE - imu->odr->code)); /* 12.5 stands for 13.02 */
    imu->period_us = 1e6 / (true_hz * (1.0 + GC_LSM6DSO_FREQ_FINE_LSB * faster));
    return error;
}

/* The pin drives what is wired to it only where a port waits for it. */
static int route_int1(gc_sensor_t *imu, uint8_t source) {
    return imu->port->wait_ready_us != NULL ? gc_sensor_write_reg(imu, GC_LSM6DSO_INT1_CTRL, source) : GC_OK;
}

static int set_up(gc_sensor_t *imu) {
    const gc_port_t *port = imu->port;
    const uint8_t odr_bits = (uint8_t)(imu->odr->code << 4);
    imu->written[0] = odr_bits; /* 2 g */
    imu->written[1] = (uint8_t)(odr_bits | imu->range->code);
    imu->written[2] = GC_LSM6DSO_CTRL3_BDU | GC_LSM6DSO_CTRL3_IF_INC;

    port->wait_until_us(port->context, port->now_us(port->context) + GC_LSM6DSO_BOOT_US);
    int error = identify(imu);
    if (error == GC_OK) {
        error = reset(imu);
    }
    if (error == GC_OK) {
        error = read_period(imu);
    }
    if (error == GC_OK) {
        error = route_int1(imu, GC_LSM6DSO_INT1_DRDY_G);
    }
    const uint8_t order[] = {2, 0, 1}; /* BDU comes first, so that no word is read in two halves */
    for (size_t i = 0; i < sizeof order && error == GC_OK; i++) {
        error = gc_sensor_write_reg(imu, (uint8_t)(GC_LSM6DSO_CTRL1_XL + order[i]), imu->written[order[i]]);
    }
    if (error == GC_OK) {
        error = gc_sensor_check_config(imu, GC_E_CONFIG_REFUSED);
    }
    if (error == GC_OK) {
        port->wait_until_us(port->context, port->now_us(port->context) + GC_LSM6DSO_TURN_ON_US);
        error = burst(imu, &imu->partial); /* the first rates are discarded */
    }
    return error;
}

static int ready(gc_sensor_t *imu) {
    uint8_t status = 0;
    const int error = gc_sensor_read_regs(imu, GC_LSM6DSO_STATUS, &status, 1);
    if (error != GC_OK) {
        return error;
    }
    return (status & GC_LSM6DSO_STATUS_GDA) != 0u ? 1 : 0;
}

/* ---- FIFO ---- */

static double temp_hz(const gc_sensor_t *imu) {
    return imu->odr_hz < 52.0 ? 12.5 : 52.0;
}

/* Bypass empties it. */
static int fifo_restart(gc_sensor_t *imu) {
    const unsigned words = 2u * imu->batch;
    const uint8_t odr_code = (uint8_t)(imu->written[1] >> 4);
    const unsigned temp_code = temp_hz(imu) < 52.0 ? 2u : 3u;
    const uint8_t ctrl[] = {(uint8_t)(words & 0xFFu), (uint8_t)(words >> 8), (uint8_t)(odr_code << 4 | odr_code),
                            (uint8_t)(temp_code << 4 | GC_LSM6DSO_FIFO_CONTINUOUS)};
    uint8_t kept[sizeof ctrl];
    int error = gc_sensor_write_reg(imu, GC_LSM6DSO_FIFO_CTRL1 + 3, 0);
    for (unsigned i = 0; i < sizeof ctrl && error == GC_OK; i++) {
        error = gc_sensor_write_reg(imu, (uint8_t)(GC_LSM6DSO_FIFO_CTRL1 + i), ctrl[i]);
    }
    if (error == GC_OK) {
        error = gc_sensor_read_regs(imu, GC_LSM6DSO_FIFO_CTRL1, kept, sizeof kept);
    }
    if (error == GC_OK && memcmp(ctrl, kept, sizeof ctrl) != 0) {
        error = GC_E_CONFIG_REFUSED;
    }
    imu->fifo_broken = error != GC_OK;
    imu->partial_has = 0;
    imu->partial_slot = 0;
    imu->fresh_us = imu->port->now_us(imu->port->context);
    return error;
}

static int fifo_begin(gc_sensor_t *imu) {
    const int error = route_int1(imu, GC_LSM6DSO_INT1_FIFO_TH);
    return error == GC_OK ? fifo_restart(imu) : error;
}

static bool even_parity(uint8_t tag) {
    unsigned ones = 0;
    for (; tag != 0u; tag = (uint8_t)(tag >> 1)) {
        ones += tag & 1u;
    }
    return ones % 2u == 0u;
}

/* A sample is whole when gyroscope and accelerometer of one time slot are there, in whatever order. */
static int take_word(gc_sensor_t *imu, const uint8_t *data, gc_batch_t *batch) {
    const unsigned tag = data[0] >> 3;
    const uint8_t slot = (uint8_t)(data[0] >> 1 & 3);
    if (!even_parity(data[0]) || tag < GC_LSM6DSO_TAG_GYRO || tag > GC_LSM6DSO_TAG_TEMP) {
        return GC_E_FIFO_TAG;
    }
    if (tag == GC_LSM6DSO_TAG_TEMP) {
        imu->partial.temp = word(data + 1);
        return GC_OK;
    }
    if (slot != imu->partial_slot) {
        imu->partial_has = 0; /* its other half was overwritten */
    }
    imu->partial_slot = slot;
    imu->partial_has = (uint8_t)(imu->partial_has | tag);
    three_words(data + 1, tag == GC_LSM6DSO_TAG_GYRO ? imu->partial.gyro : imu->partial.acc);
    if (imu->partial_has == (GC_LSM6DSO_TAG_GYRO | GC_LSM6DSO_TAG_ACC)) {
        imu->partial_has = 0;
        imu->partial.fresh = true;
        batch->sample[batch->n++] = imu->partial;
    }
    return GC_OK;
}

static int take_words(gc_sensor_t *imu, unsigned words, gc_batch_t *batch) {
    uint8_t data[BURST_WORDS * GC_LSM6DSO_FIFO_WORD_BYTES];
    int error = GC_OK;
    while (error == GC_OK && words > 0u && batch->n + BURST_WORDS / 2u < GC_BATCH_MAX) {
        const unsigned n = words < BURST_WORDS ? words : BURST_WORDS;
        error = gc_sensor_read_regs(imu, GC_LSM6DSO_FIFO_DATA_OUT_TAG, data, n * GC_LSM6DSO_FIFO_WORD_BYTES);
        for (unsigned i = 0; i < n && error == GC_OK; i++) {
            error = take_word(imu, data + i * GC_LSM6DSO_FIFO_WORD_BYTES, batch);
        }
        words -= n;
    }
    imu->fifo_broken = error != GC_OK; /* the start of the next word is unknown */
    batch->left = (unsigned)((double)words / (2.0 + temp_hz(imu) / imu->odr_hz));
    return error;
}

static int fifo_read(gc_sensor_t *imu, gc_batch_t *batch) {
    uint8_t status[2] = {0, 0};
    batch->gap = imu->fifo_broken;
    int error = imu->fifo_broken ? fifo_restart(imu) : GC_OK;
    batch->t_us = imu->port->now_us(imu->port->context);
    if (error == GC_OK) {
        error = gc_sensor_read_regs(imu, GC_LSM6DSO_FIFO_STATUS1, status, sizeof status);
    }
    if (error != GC_OK) {
        return error;
    }
    batch->until_us = imu->port->now_us(imu->port->context);
    const unsigned words = (unsigned)(status[1] & 3) << 8 | status[0];
    batch->overrun = (status[1] & GC_LSM6DSO_FIFO_OVERRUN) != 0u;
    if (batch->overrun) {
        batch->gap = true;
        imu->partial_has = 0;
    }
    if (words == 0u) {
        return GC_OK;
    }
    imu->fresh_us = batch->until_us;
    return take_words(imu, words, batch);
}

/* The part's table of ranges; what the parts with a FIFO of tagged words have; what all of the family have. */
#define WITH_RANGES(table) .range = (table), .ranges = sizeof(table) / sizeof(table)[0]
/* Samples of at most three words: a quarter of the FIFO is left for delays. */
#define WITH_FIFO                                                                                                        \
    .traits = GC_LSM6_HAS_I3C | GC_LSM6_HAS_FREQ_FINE, .batch_max = 128, .fifo_begin = fifo_begin, .fifo_read = fifo_read
#define ALIKE                                                                                                            \
    .address = {GC_LSM6DSO_ADDRESS, GC_LSM6DSO_ADDRESS_LOW}, .odr = odrs, .odrs = sizeof odrs / sizeof odrs[0],          \
    .polled_from_hz = 416.0, .watched_reg = GC_LSM6DSO_CTRL1_XL, .watched = CTRL_REGS, .identify = identify,             \
    .set_up = set_up, .ready = ready, .read = burst

const gc_part_t gc_lsm6dso = {
    .name = "LSM6DSO", .id = GC_LSM6DSO_ID,
    .lsb_g = 0.000061, /* at 2 g */
    .lsb_c = 1.0 / 256.0,
    .noise_dps = 0.0448, /* 3.8 mdps/sqrt(Hz) within the filter of 416 Hz */
    .zero_c = 25.0,
    WITH_RANGES(ranges), WITH_FIFO, ALIKE,
};
const gc_part_t gc_lsm6dsox = {
    .name = "LSM6DSOX", .id = GC_LSM6DSO_ID, .lsb_g = 0.000061, .lsb_c = 1.0 / 256.0, .noise_dps = 0.0448, .zero_c = 25.0,
    WITH_RANGES(ranges), WITH_FIFO, ALIKE,
};
const gc_part_t gc_lsm6dso32 = {
    .name = "LSM6DSO32", .id = GC_LSM6DSO_ID, .lsb_g = 0.000122, .lsb_c = 1.0 / 256.0, .noise_dps = 0.0448, .zero_c = 25.0,
    WITH_RANGES(ranges), WITH_FIFO, ALIKE,
};
/* The density of its noise, 5 mdps/sqrt(Hz), and that of the two below, 5 and 7, are those of their datasheets. */
const gc_part_t gc_lsm6dsr = {
    .name = "LSM6DSR", .id = GC_LSM6DSR_ID, .lsb_g = 0.000061, .lsb_c = 1.0 / 256.0, .noise_dps = 0.059, .zero_c = 25.0,
    WITH_RANGES(dsr_ranges), WITH_FIFO, ALIKE,
};
const gc_part_t gc_lsm6ds3trc = {
    .name = "LSM6DS3TR-C", .id = GC_LSM6DS3TRC_ID, .lsb_g = 0.000061, .lsb_c = 1.0 / 256.0, .noise_dps = 0.059, .zero_c = 25.0,
    WITH_RANGES(ranges), ALIKE,
};
const gc_part_t gc_lsm6ds3 = {
    .name = "LSM6DS3", .id = GC_LSM6DS3_ID, .lsb_g = 0.000061, .lsb_c = 1.0 / 16.0, .noise_dps = 0.083, .zero_c = 25.0,
    WITH_RANGES(ranges), ALIKE,
};
