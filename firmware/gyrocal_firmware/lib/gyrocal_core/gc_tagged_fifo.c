#include "gc_tagged_fifo.h"

#include "gc_error.h"

#include <string.h>

#define BURST_WORDS 16u /* boards' I2C buffers hold 128 bytes */
#define FIFO_CTRL1 0x07
#define FIFO_DATA_OUT_TAG 0x78
#define CONTINUOUS 0x06u /* FIFO_CTRL4: the newest overwrite the oldest */
#define OVERRUN 0x48u    /* FIFO_STATUS2: it is full, or was since this register was last read */
#define TAG_GYRO 0x01u
#define TAG_ACC 0x02u
#define TAG_TEMP 0x03u
#define TAG_STAMP 0x04u
#define STAMP_EVERY_32 0xC0u /* FIFO_CTRL4 */
#define STAMP_SAMPLES 32.0
#define NO_SLOT 4u
#define WORD_BYTES 7u /* a tag and three values */

static double temp_hz(const gc_tagged_fifo_t *fifo, const gc_sensor_t *imu) {
    return imu->odr_hz < fifo->temp_hz ? fifo->slow_temp_hz : fifo->temp_hz;
}

static bool gyro_alone(const gc_sensor_t *imu) {
    return imu->odr_hz > GC_FIFO_ALONE_HZ;
}

static double words_a_sample(const gc_tagged_fifo_t *fifo, const gc_sensor_t *imu) {
    const double acc_hz = gyro_alone(imu) ? fifo->acc_hz : imu->odr_hz;
    return 1.0 + 1.0 / STAMP_SAMPLES + (acc_hz + temp_hz(fifo, imu)) / imu->odr_hz;
}

int gc_tagged_fifo_restart(const gc_tagged_fifo_t *fifo, gc_sensor_t *imu) {
    const unsigned words = gyro_alone(imu) ? imu->batch : 2u * imu->batch;
    const uint8_t odr_code = imu->odr->code;
    const uint8_t acc_code = gyro_alone(imu) ? fifo->acc_code : odr_code;
    const unsigned temp_code = temp_hz(fifo, imu) < fifo->temp_hz ? 2u : 3u;
    const uint8_t ctrl[] = {(uint8_t)(words & 0xFFu), (uint8_t)(words >> 8), (uint8_t)(odr_code << 4 | acc_code),
                            (uint8_t)(STAMP_EVERY_32 | temp_code << 4 | CONTINUOUS)};
    uint8_t kept[sizeof ctrl];
    int error = gc_sensor_write_reg(imu, FIFO_CTRL1 + 3, 0); /* bypass empties it */
    for (unsigned i = 0; i < sizeof ctrl && error == GC_OK; i++) {
        error = gc_sensor_write_reg(imu, (uint8_t)(FIFO_CTRL1 + i), ctrl[i]);
    }
    if (error == GC_OK) {
        error = gc_sensor_read_regs(imu, FIFO_CTRL1, kept, sizeof kept);
    }
    if (error == GC_OK && memcmp(ctrl, kept, sizeof ctrl) != 0) {
        error = GC_E_CONFIG_REFUSED;
    }
    imu->fifo_broken = error != GC_OK;
    imu->partial_has = 0;
    imu->partial_slot = 0;
    imu->whole_slot = NO_SLOT;
    imu->fresh_us = imu->port->now_us(imu->port->context);
    return error;
}

static bool even_parity(uint8_t tag) {
    unsigned ones = 0;
    for (; tag != 0u; tag = (uint8_t)(tag >> 1)) {
        ones += tag & 1u;
    }
    return ones % 2u == 0u;
}

/* Counts the samples that were lost since the stamp before, or learns how many ticks a sample takes. What was lost before the first
   stamp of a batch is known from that one alone. */
static void count_lost(gc_stamps_t *stamps, uint32_t ticks, uint32_t came, gc_batch_t *batch) {
    const double passed = stamps->ticks_a_sample > 0.0 ? (double)(ticks - stamps->ticks) / stamps->ticks_a_sample + 0.5 : came;
    const uint32_t samples = passed < 4e9 ? (uint32_t)passed : came;
    batch->lost_known = batch->stamps == 0u ? stamps->ticks_a_sample > 0.0 : batch->lost_known;
    if (samples > came) {
        batch->lost += samples - came;
        stamps->base_ticks = ticks;
        stamps->base_samples = 0;
        return;
    }
    stamps->base_samples += came;
    if (stamps->base_samples > 0u) {
        stamps->ticks_a_sample = (double)(ticks - stamps->base_ticks) / stamps->base_samples;
    }
}

/* A stamp is of the sample in its time slot, which may be whole already. */
static void take_stamp(gc_sensor_t *imu, uint8_t slot, const uint8_t *data, gc_batch_t *batch) {
    gc_stamps_t *stamps = &imu->stamps;
    const uint32_t ticks = (uint32_t)data[1] | (uint32_t)data[2] << 8 | (uint32_t)data[3] << 16 | (uint32_t)data[4] << 24;
    const bool comes_next = slot != imu->whole_slot;
    if (stamps->known) {
        count_lost(stamps, ticks, (uint32_t)(stamps->since + (comes_next ? 1 : 0)), batch);
    } else {
        stamps->base_ticks = ticks;
        stamps->base_samples = 0;
    }
    batch->stamps++;
    stamps->known = true;
    stamps->ticks = ticks;
    stamps->since = comes_next ? -1 : 0;
}

/* A sample is whole when gyroscope and accelerometer of one time slot are there, in whatever order; where the accelerometer's come more
   slowly, with the gyroscope's word. */
static int take_word(const gc_tagged_fifo_t *fifo, gc_sensor_t *imu, const uint8_t *data, gc_batch_t *batch) {
    const unsigned tag = data[0] >> 3;
    const uint8_t slot = (uint8_t)(data[0] >> 1 & 3);
    if ((fifo->has_parity && !even_parity(data[0])) || tag < TAG_GYRO || tag > TAG_STAMP) {
        return GC_E_FIFO_TAG;
    }
    if (tag == TAG_TEMP) {
        imu->partial.temp = gc_sensor_word(data[2], data[1]);
        return GC_OK;
    }
    if (tag == TAG_STAMP) {
        take_stamp(imu, slot, data, batch);
        return GC_OK;
    }
    if (slot != imu->partial_slot) {
        imu->partial_has = 0; /* its other half was overwritten */
    }
    imu->partial_slot = slot;
    imu->partial_has = (uint8_t)(imu->partial_has | tag);
    for (size_t i = 0; i < 3u; i++) {
        (tag == TAG_GYRO ? imu->partial.gyro : imu->partial.acc)[i] = gc_sensor_word(data[2u + 2u * i], data[1u + 2u * i]);
    }
    if (gyro_alone(imu) ? tag == TAG_GYRO : imu->partial_has == (TAG_GYRO | TAG_ACC)) {
        imu->partial_has = 0;
        imu->partial.fresh = true;
        imu->whole_slot = slot;
        imu->stamps.since++;
        batch->sample[batch->n++] = imu->partial;
    }
    return GC_OK;
}

static int take_words(const gc_tagged_fifo_t *fifo, gc_sensor_t *imu, unsigned words, gc_batch_t *batch) {
    const unsigned most = gyro_alone(imu) ? BURST_WORDS : BURST_WORDS / 2u; /* samples in a burst */
    uint8_t data[BURST_WORDS * WORD_BYTES];
    int error = GC_OK;
    while (error == GC_OK && words > 0u && batch->n + most < GC_BATCH_MAX) {
        const unsigned n = words < BURST_WORDS ? words : BURST_WORDS;
        error = gc_sensor_read_regs(imu, FIFO_DATA_OUT_TAG, data, n * WORD_BYTES);
        for (unsigned i = 0; i < n && error == GC_OK; i++) {
            error = take_word(fifo, imu, data + i * WORD_BYTES, batch);
        }
        words -= n;
    }
    imu->fifo_broken = error != GC_OK; /* the start of the next word is unknown */
    batch->left = (unsigned)((double)words / words_a_sample(fifo, imu));
    return error;
}

/* Before the ticks of a sample are known, samples that are missing would be taken for none. */
static void forget_stamps(gc_stamps_t *stamps) {
    if (!(stamps->ticks_a_sample > 0.0)) {
        stamps->known = false;
    }
}

int gc_tagged_fifo_read(const gc_tagged_fifo_t *fifo, gc_sensor_t *imu, gc_batch_t *batch) {
    uint8_t status[2] = {0, 0};
    batch->gap = imu->fifo_broken;
    int error = imu->fifo_broken ? gc_tagged_fifo_restart(fifo, imu) : GC_OK;
    batch->t_us = imu->port->now_us(imu->port->context);
    if (error == GC_OK) {
        error = gc_sensor_read_regs(imu, fifo->status_reg, status, sizeof status);
    }
    if (error != GC_OK) {
        return error;
    }
    batch->until_us = imu->port->now_us(imu->port->context);
    const unsigned words = (unsigned)(status[1] & ((1u << fifo->level_bits) - 1u)) << 8 | status[0];
    batch->overrun = (status[1] & OVERRUN) != 0u;
    if (batch->overrun) {
        batch->gap = true;
        imu->partial_has = 0;
        imu->whole_slot = NO_SLOT;
    }
    if (batch->gap) {
        forget_stamps(&imu->stamps);
    }
    if (words == 0u) {
        return GC_OK;
    }
    imu->fresh_us = batch->until_us;
    return take_words(fifo, imu, words, batch);
}
