#include "gc_lsm6dso.h"

#include "gc_error.h"

#include <string.h>

#define STALE_PERIODS 3.0
#define BURST_WORDS 16u /* of the FIFO: boards' I2C buffers hold 128 bytes */
#define POLL_MARGIN 1.2 /* polled at nearly its own rate, the part often has nothing new */

static const double odr_hz_of_code[] = {0.0, 12.5, 26.0, 52.0, 104.0, 208.0, 416.0, 833.0, 1666.0};
#define ODR_CODES (sizeof odr_hz_of_code / sizeof odr_hz_of_code[0])
#define ODR_CODE_416 6u

static const struct {
    double full_scale_dps;
    double lsb_dps;
    uint8_t bits;
} ranges[] = {
    {125.0, 0.004375, 0x02}, {250.0, 0.00875, 0x00}, {500.0, 0.0175, 0x04}, {1000.0, 0.035, 0x08}, {2000.0, 0.070, 0x0C},
};
#define RANGES (sizeof ranges / sizeof ranges[0])

double gc_lsm6dso_odr_for(double rate_hz) {
    for (size_t i = 1; i < ODR_CODES; i++) {
        if (odr_hz_of_code[i] == rate_hz) {
            return rate_hz;
        }
    }
    for (size_t i = ODR_CODE_416; i < ODR_CODES; i++) {
        if (odr_hz_of_code[i] >= POLL_MARGIN * rate_hz && rate_hz > 0.0) {
            return odr_hz_of_code[i];
        }
    }
    return 0.0;
}

static int range_of(double full_scale_dps) {
    for (size_t i = 0; i < RANGES; i++) {
        if (ranges[i].full_scale_dps == full_scale_dps) {
            return (int)i;
        }
    }
    return -1;
}

bool gc_lsm6dso_full_scale_ok(double full_scale_dps) {
    return range_of(full_scale_dps) >= 0;
}

static int write_reg(gc_lsm6dso_t *imu, uint8_t reg, uint8_t value) {
    return imu->port->bus_write(imu->port->context, imu->address, reg, &value, 1) < 0 ? GC_E_BUS_NACK : GC_OK;
}

static int read_regs(gc_lsm6dso_t *imu, uint8_t reg, uint8_t *data, size_t n) {
    const int got = imu->port->bus_read(imu->port->context, imu->address, reg, data, n);
    if (got < 0) {
        return GC_E_BUS_NACK;
    }
    return (size_t)got == n ? GC_OK : GC_E_BUS_SHORT;
}

static int16_t word(const uint8_t *data) {
    return (int16_t)((data[1] & 0x80u ? -0x8000 : 0) + ((data[1] & 0x7F) << 8 | data[0]));
}

static void three_words(const uint8_t *data, int16_t out[3]) {
    for (size_t i = 0; i < 3u; i++) {
        out[i] = word(data + 2u * i);
    }
}

static int burst(gc_lsm6dso_t *imu, gc_sample_t *sample) {
    uint8_t data[14];
    const int error = read_regs(imu, GC_LSM6DSO_OUT_TEMP_L, data, sizeof data);
    if (error != GC_OK) {
        return error;
    }
    sample->temp = word(data);
    three_words(data + 2, sample->gyro);
    three_words(data + 8, sample->acc);
    return GC_OK;
}

static int reset(gc_lsm6dso_t *imu) {
    const gc_port_t *port = imu->port;
    int error = write_reg(imu, GC_LSM6DSO_CTRL3_C, GC_LSM6DSO_CTRL3_SW_RESET | GC_LSM6DSO_CTRL3_IF_INC);
    const uint64_t start = port->now_us(port->context);
    uint8_t ctrl3 = GC_LSM6DSO_CTRL3_SW_RESET;
    while (error == GC_OK && (ctrl3 & GC_LSM6DSO_CTRL3_SW_RESET)) {
        const uint64_t now = port->now_us(port->context);
        if (now - start > GC_LSM6DSO_RESET_TIMEOUT_US) {
            return GC_E_RESET_TIMEOUT;
        }
        port->wait_until_us(port->context, now + 50u);
        error = read_regs(imu, GC_LSM6DSO_CTRL3_C, &ctrl3, 1);
    }
    return error;
}

static int check_config(gc_lsm6dso_t *imu, int error_if_other) {
    uint8_t ctrl[3];
    const int error = read_regs(imu, GC_LSM6DSO_CTRL1_XL, ctrl, sizeof ctrl);
    if (error != GC_OK) {
        return error;
    }
    return memcmp(ctrl, imu->ctrl, sizeof ctrl) == 0 ? GC_OK : error_if_other;
}

int gc_lsm6dso_init(gc_lsm6dso_t *imu, const gc_port_t *port, uint8_t address, double odr_hz, double full_scale_dps) {
    const int range = range_of(full_scale_dps);
    uint8_t odr_code = 0;
    for (size_t i = 1; i < ODR_CODES; i++) {
        if (odr_hz_of_code[i] == odr_hz) {
            odr_code = (uint8_t)i;
        }
    }
    if (range < 0 || odr_code == 0u) {
        return GC_E_ARGUMENT;
    }
    imu->port = port;
    imu->address = address;
    imu->odr_hz = odr_hz;
    imu->full_scale_dps = full_scale_dps;
    imu->lsb_dps = ranges[range].lsb_dps;
    imu->ctrl[0] = (uint8_t)(odr_code << 4); /* 2 g */
    imu->ctrl[1] = (uint8_t)(odr_code << 4 | ranges[range].bits);
    imu->ctrl[2] = GC_LSM6DSO_CTRL3_BDU | GC_LSM6DSO_CTRL3_IF_INC;

    port->wait_until_us(port->context, port->now_us(port->context) + GC_LSM6DSO_BOOT_US);
    uint8_t id = 0;
    int error = read_regs(imu, GC_LSM6DSO_WHO_AM_I, &id, 1);
    if (error == GC_OK && id != GC_LSM6DSO_ID) {
        error = GC_E_WRONG_ID;
    }
    if (error == GC_OK) {
        error = reset(imu);
    }
    uint8_t ctrl9 = 0;
    uint8_t freq_fine = 0;
    if (error == GC_OK) {
        error = read_regs(imu, GC_LSM6DSO_CTRL9_XL, &ctrl9, 1);
    }
    if (error == GC_OK) {
        error = read_regs(imu, GC_LSM6DSO_FREQ_FINE, &freq_fine, 1);
    }
    const int faster = freq_fine < 128u ? freq_fine : freq_fine - 256;
    const double true_hz = GC_LSM6DSO_ROOT_HZ / (double)(1u << (GC_LSM6DSO_ROOT_CODE - odr_code)); /* 12.5 stands for 13.02 */
    imu->period_us = 1e6 / (true_hz * (1.0 + GC_LSM6DSO_FREQ_FINE_LSB * faster));
    if (error == GC_OK) { /* an I3C master is not there; its bus would take noise for its own start condition */
        error = write_reg(imu, GC_LSM6DSO_CTRL9_XL, (uint8_t)(ctrl9 | GC_LSM6DSO_CTRL9_I3C_DISABLE));
    }
    if (error == GC_OK) {
        error = write_reg(imu, GC_LSM6DSO_INT1_CTRL, GC_LSM6DSO_INT1_DRDY_G);
    }
    const uint8_t order[] = {2, 0, 1}; /* BDU first: no word may tear once data flow */
    for (size_t i = 0; i < sizeof order && error == GC_OK; i++) {
        error = write_reg(imu, (uint8_t)(GC_LSM6DSO_CTRL1_XL + order[i]), imu->ctrl[order[i]]);
    }
    if (error == GC_OK) {
        error = check_config(imu, GC_E_CONFIG_REFUSED);
    }
    if (error == GC_OK) {
        port->wait_until_us(port->context, port->now_us(port->context) + GC_LSM6DSO_TURN_ON_US);
        error = burst(imu, &imu->partial); /* its rates are discarded */
    }
    imu->batch = 0;
    imu->config_checked_us = port->now_us(port->context);
    imu->fresh_us = imu->config_checked_us;
    return error;
}

static double periods(const gc_lsm6dso_t *imu, uint64_t from_us, uint64_t to_us) {
    return to_us > from_us ? (double)(to_us - from_us) / imu->period_us : 0.0;
}

int gc_lsm6dso_ready(gc_lsm6dso_t *imu) {
    uint8_t status = 0;
    const int error = read_regs(imu, GC_LSM6DSO_STATUS, &status, 1);
    if (error != GC_OK) {
        return error;
    }
    return (status & GC_LSM6DSO_STATUS_GDA) != 0u ? 1 : 0;
}

int gc_lsm6dso_read(gc_lsm6dso_t *imu, gc_sample_t *sample) {
    const uint64_t now = imu->port->now_us(imu->port->context);
    const int ready = gc_lsm6dso_ready(imu);
    if (ready < 0) {
        return ready;
    }
    sample->fresh = ready == 1;
    int error = GC_OK;
    if (sample->fresh) {
        error = burst(imu, sample);
        imu->fresh_us = imu->port->now_us(imu->port->context); /* however long that took: what comes from here on is new */
    } else if (periods(imu, imu->fresh_us, now) > STALE_PERIODS) {
        error = check_config(imu, GC_E_CONFIG_LOST);
        return error != GC_OK ? error : GC_E_STALE;
    }
    if (error == GC_OK && now - imu->config_checked_us >= GC_LSM6DSO_CONFIG_CHECK_US) {
        error = check_config(imu, GC_E_CONFIG_LOST);
        imu->config_checked_us = now;
    }
    return error;
}

/* ---- FIFO ---- */

static double temp_hz(const gc_lsm6dso_t *imu) {
    return imu->odr_hz < 52.0 ? 12.5 : 52.0;
}

/* Bypass empties it. */
static int fifo_restart(gc_lsm6dso_t *imu) {
    const unsigned words = 2u * imu->batch;
    const uint8_t odr_code = (uint8_t)(imu->ctrl[1] >> 4);
    const unsigned temp_code = temp_hz(imu) < 52.0 ? 2u : 3u;
    const uint8_t ctrl[] = {(uint8_t)(words & 0xFFu), (uint8_t)(words >> 8), (uint8_t)(odr_code << 4 | odr_code),
                            (uint8_t)(temp_code << 4 | GC_LSM6DSO_FIFO_CONTINUOUS)};
    uint8_t kept[sizeof ctrl];
    int error = write_reg(imu, GC_LSM6DSO_FIFO_CTRL1 + 3, 0);
    for (unsigned i = 0; i < sizeof ctrl && error == GC_OK; i++) {
        error = write_reg(imu, (uint8_t)(GC_LSM6DSO_FIFO_CTRL1 + i), ctrl[i]);
    }
    if (error == GC_OK) {
        error = read_regs(imu, GC_LSM6DSO_FIFO_CTRL1, kept, sizeof kept);
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

int gc_lsm6dso_fifo_begin(gc_lsm6dso_t *imu, unsigned batch) {
    if (batch == 0u || batch > GC_LSM6DSO_FIFO_BATCH_MAX) {
        return GC_E_ARGUMENT;
    }
    imu->batch = batch;
    const int error = write_reg(imu, GC_LSM6DSO_INT1_CTRL, GC_LSM6DSO_INT1_FIFO_TH);
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
static int take_word(gc_lsm6dso_t *imu, const uint8_t *data, gc_lsm6dso_batch_t *batch) {
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

static int take_words(gc_lsm6dso_t *imu, unsigned words, gc_lsm6dso_batch_t *batch) {
    uint8_t data[BURST_WORDS * GC_LSM6DSO_FIFO_WORD_BYTES];
    int error = GC_OK;
    while (error == GC_OK && words > 0u && batch->n + BURST_WORDS / 2u < GC_LSM6DSO_FIFO_BATCH_MAX) {
        const unsigned n = words < BURST_WORDS ? words : BURST_WORDS;
        error = read_regs(imu, GC_LSM6DSO_FIFO_DATA_OUT_TAG, data, n * GC_LSM6DSO_FIFO_WORD_BYTES);
        for (unsigned i = 0; i < n && error == GC_OK; i++) {
            error = take_word(imu, data + i * GC_LSM6DSO_FIFO_WORD_BYTES, batch);
        }
        words -= n;
    }
    imu->fifo_broken = error != GC_OK; /* who knows where the next word begins */
    batch->left = (unsigned)((double)words / (2.0 + temp_hz(imu) / imu->odr_hz));
    return error;
}

int gc_lsm6dso_fifo_read(gc_lsm6dso_t *imu, gc_lsm6dso_batch_t *batch) {
    uint8_t status[2] = {0, 0};
    batch->n = 0;
    batch->left = 0;
    batch->overrun = false;
    batch->gap = imu->fifo_broken;
    int error = imu->fifo_broken ? fifo_restart(imu) : GC_OK;
    batch->t_us = imu->port->now_us(imu->port->context);
    if (error == GC_OK) {
        error = read_regs(imu, GC_LSM6DSO_FIFO_STATUS1, status, sizeof status);
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
    if (words > 0u) {
        imu->fresh_us = batch->until_us;
        error = take_words(imu, words, batch);
    } else if (periods(imu, imu->fresh_us, batch->t_us) > STALE_PERIODS) {
        error = check_config(imu, GC_E_CONFIG_LOST);
        return error != GC_OK ? error : GC_E_STALE;
    }
    if (error == GC_OK && batch->t_us - imu->config_checked_us >= GC_LSM6DSO_CONFIG_CHECK_US) {
        error = check_config(imu, GC_E_CONFIG_LOST);
        imu->config_checked_us = batch->t_us;
    }
    return error;
}
