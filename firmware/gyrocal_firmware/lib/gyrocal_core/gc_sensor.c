#include "gc_sensor.h"

#include "gc_bus.h"
#include "gc_error.h"

#include <math.h>
#include <string.h>

#define STALE_PERIODS 3.0 /* output periods without new data after which the part is at fault; chosen by judgement */
#define FIND_HZ 1000000u /* of SPI, which every part bears */
#define POLL_MARGIN 1.2 /* output rate over polling rate: a part that is polled at nearly its own rate often has nothing new */

static const gc_odr_t *odr_of(const gc_part_t *part, double hz) {
    for (size_t i = 0; i < part->odrs; i++) {
        if (part->odr[i].hz == hz) {
            return &part->odr[i];
        }
    }
    return NULL;
}

static const gc_range_t *range_of(const gc_part_t *part, double full_scale_dps) {
    for (size_t i = 0; i < part->ranges; i++) {
        if (part->range[i].full_scale_dps == full_scale_dps) {
            return &part->range[i];
        }
    }
    return NULL;
}

double gc_part_odr_for(const gc_part_t *part, double rate_hz) {
    if (odr_of(part, rate_hz) != NULL) {
        return rate_hz;
    }
    for (size_t i = 0; i < part->odrs; i++) {
        const double hz = part->odr[i].hz;
        if (hz >= part->polled_from_hz && hz <= GC_FIFO_ALONE_HZ && hz >= POLL_MARGIN * rate_hz && rate_hz > 0.0) {
            return hz;
        }
    }
    return 0.0;
}

/* 0 stands for the least one. */
static const gc_accel_t *accel_of(const gc_part_t *part, double accel_g) {
    for (size_t i = 0; i < part->accels; i++) {
        if (accel_g == 0.0 || part->accel[i].g == accel_g) {
            return &part->accel[i];
        }
    }
    return NULL;
}

bool gc_part_accel_ok(const gc_part_t *part, double accel_g) {
    return accel_of(part, accel_g) != NULL;
}

bool gc_part_low_pass_ok(const gc_part_t *part, double odr_hz, double low_pass) {
    const unsigned most = part->low_passes_at != NULL ? part->low_passes_at(odr_hz) : part->low_passes;
    return low_pass >= 0.0 && low_pass <= (double)most;
}

bool gc_part_full_scale_ok(const gc_part_t *part, double full_scale_dps) {
    return range_of(part, full_scale_dps) != NULL;
}

bool gc_part_may_be_at(const gc_part_t *part, const gc_port_t *port, uint8_t address) {
    return port->spi != NULL ? part->spi[0] != NULL : part->address[0] == address || part->address[1] == address;
}

const gc_part_t *gc_part_at(const gc_part_t *const *parts, const gc_port_t *port, uint8_t address) {
    while (*parts != NULL && !gc_part_may_be_at(*parts, port, address)) {
        parts++;
    }
    return *parts;
}

/* Whatever part it is hears all that is asked, so that nothing is written. Ids at the end of the registers are asked for first: at
   their beginning other parts have codes of the self-test, which may be any number. */
static int find_on_spi(const gc_part_t *const *parts, const gc_port_t *port, const gc_part_t **found) {
    int result = GC_E_BUS_NACK;
    for (unsigned reg = 0x80; reg-- > 0u;) {
        for (const gc_part_t *const *part = parts; *part != NULL; part++) {
            if ((*part)->spi[0] == NULL || (*part)->id_reg != reg) {
                continue;
            }
            gc_spi_t slow = *(*part)->spi[0];
            slow.most_hz = FIND_HZ;
            gc_sensor_t sensor = {.part = *part, .port = port, .spi = {&slow, NULL}};
            const int error = gc_sensor_check_id(&sensor, 0, (*part)->id_reg, (*part)->id);
            if (error == GC_OK) {
                *found = *part;
                return GC_OK;
            }
            result = error == GC_E_WRONG_ID ? error : result;
        }
    }
    return result;
}

int gc_part_find(const gc_part_t *const *parts, const gc_port_t *port, uint8_t address, const gc_part_t **found) {
    if (port->spi != NULL) {
        return find_on_spi(parts, port, found);
    }
    int result = GC_E_WRONG_ID;
    for (; *parts != NULL; parts++) {
        gc_sensor_t sensor = {.part = *parts, .port = port, .address = address};
        const int error = gc_part_may_be_at(*parts, port, address) ? (*parts)->identify(&sensor) : GC_E_WRONG_ID;
        if (error == GC_OK) {
            *found = *parts;
            return GC_OK;
        }
        result = error == GC_E_WRONG_ID ? result : error;
    }
    return result;
}

uint8_t gc_part_look(const gc_part_t *const *parts, const gc_port_t *port, const gc_part_t **found) {
    *found = NULL;
    if (port->spi != NULL) {
        (void)find_on_spi(parts, port, found);
        return *found != NULL ? (*found)->address[0] : parts[0]->address[0];
    }
    for (size_t k = 0; k < 2u; k++) {
        for (const gc_part_t *const *part = parts; *part != NULL; part++) {
            const uint8_t address = (*part)->address[k];
            const bool is_new = gc_part_at(parts, port, address) == *part;
            if (is_new && gc_part_find(parts, port, address, found) == GC_OK) {
                return address;
            }
        }
    }
    return parts[0]->address[0];
}

double gc_sensor_temp_c(const gc_part_t *part, int64_t sum, uint32_t n) {
    return n == 0u ? NAN : part->zero_c + part->lsb_c * (double)sum / (double)n;
}

int16_t gc_sensor_word(uint8_t high, uint8_t low) {
    return (int16_t)((high & 0x80u ? -0x8000 : 0) + ((high & 0x7F) << 8 | low));
}

void gc_sensor_words_low_first(const uint8_t *data, int16_t out[3]) {
    for (size_t i = 0; i < 3u; i++) {
        out[i] = gc_sensor_word(data[2u * i + 1u], data[2u * i]);
    }
}

void gc_sensor_words_high_first(const uint8_t *data, int16_t out[3]) {
    for (size_t i = 0; i < 3u; i++) {
        out[i] = gc_sensor_word(data[2u * i], data[2u * i + 1u]);
    }
}

void gc_sensor_wait_us(const gc_sensor_t *sensor, uint64_t us) {
    sensor->port->wait_until_us(sensor->port->context, sensor->port->now_us(sensor->port->context) + us);
}

int gc_sensor_write_reg(gc_sensor_t *sensor, uint8_t reg, uint8_t value) {
    return gc_bus_write(sensor, 0, reg, &value, 1);
}

int gc_sensor_write_regs(gc_sensor_t *sensor, uint8_t reg, const uint8_t *data, size_t n) {
    return gc_bus_write(sensor, 0, reg, data, n);
}

int gc_sensor_read_regs(gc_sensor_t *sensor, uint8_t reg, uint8_t *data, size_t n) {
    return gc_bus_read(sensor, 0, reg, data, n);
}

/* A first reading in vain takes a die that starts as one of I2C over to SPI. A line that nobody drives is high or low. */
int gc_sensor_check_id(gc_sensor_t *sensor, unsigned die, uint8_t reg, uint8_t id) {
    const gc_spi_t *spi = sensor->spi[die];
    uint8_t found = 0;
    if (spi != NULL && spi->starts_as_i2c) {
        (void)gc_bus_read(sensor, die, reg, &found, 1);
    }
    const int error = gc_bus_read(sensor, die, reg, &found, 1);
    if (error != GC_OK || found == id) {
        return error;
    }
    return spi != NULL && (found == 0x00u || found == 0xFFu) ? GC_E_BUS_NACK : GC_E_WRONG_ID;
}

int gc_sensor_leave_i2c(gc_sensor_t *sensor) {
    const gc_spi_t *spi = sensor->spi[0];
    return spi != NULL ? gc_sensor_change_bits(sensor, spi->i2c_off_reg, 0, spi->i2c_off) : GC_OK;
}

int gc_sensor_wait_for_bits(gc_sensor_t *sensor, uint8_t reg, uint8_t mask, uint8_t wanted, uint64_t look_us, uint64_t timeout_us) {
    const gc_port_t *port = sensor->port;
    const uint64_t start = port->now_us(port->context);
    uint8_t found = 0;
    int error;
    do {
        if (port->now_us(port->context) - start > timeout_us) {
            return GC_E_RESET_TIMEOUT;
        }
        gc_sensor_wait_us(sensor, look_us);
        error = gc_sensor_read_regs(sensor, reg, &found, 1);
    } while (error == GC_OK && (found & mask) != wanted);
    return error;
}

int gc_sensor_ready_once(gc_sensor_t *sensor, uint8_t reg, uint8_t flag) {
    uint8_t status = 0;
    const int error = sensor->data_wait ? GC_OK : gc_sensor_read_regs(sensor, reg, &status, 1);
    if (error != GC_OK) {
        return error;
    }
    sensor->data_wait = sensor->data_wait || (status & flag) != 0u;
    return sensor->data_wait ? 1 : 0;
}

int gc_sensor_write_steps(gc_sensor_t *sensor, const uint8_t (*steps)[2], size_t n) {
    int error = GC_OK;
    for (size_t i = 0; i < n && error == GC_OK; i++) {
        error = gc_sensor_write_reg(sensor, steps[i][0], steps[i][1]);
    }
    return error;
}

int gc_sensor_change_bits(gc_sensor_t *sensor, uint8_t reg, uint8_t mask, uint8_t value) {
    uint8_t found = 0;
    const int error = gc_sensor_read_regs(sensor, reg, &found, 1);
    return error != GC_OK ? error : gc_sensor_write_reg(sensor, reg, (uint8_t)((found & ~mask) | value));
}

int gc_sensor_write_other(gc_sensor_t *sensor, uint8_t reg, uint8_t value) {
    return gc_bus_write(sensor, 1, reg, &value, 1);
}

int gc_sensor_read_other(gc_sensor_t *sensor, uint8_t reg, uint8_t *data, size_t n) {
    return gc_bus_read(sensor, 1, reg, data, n);
}

int gc_sensor_check_config(gc_sensor_t *sensor, int error_if_other) {
    const gc_part_t *part = sensor->part;
    uint8_t found[GC_WATCHED_MAX];
    const int error = part->read_watched != NULL ? part->read_watched(sensor, found)
                                                 : gc_sensor_read_regs(sensor, part->watched_reg, found, part->watched);
    if (error != GC_OK) {
        return error;
    }
    return memcmp(found, sensor->written, part->watched) == 0 ? GC_OK : error_if_other;
}

int gc_sensor_init(gc_sensor_t *sensor, const gc_part_t *part, const gc_port_t *port, uint8_t address, const gc_setup_t *setup) {
    const gc_odr_t *odr = odr_of(part, setup->odr_hz);
    const gc_range_t *range = range_of(part, setup->full_scale_dps);
    const gc_accel_t *accel = accel_of(part, setup->accel_g);
    if (odr == NULL || range == NULL || accel == NULL || !gc_part_low_pass_ok(part, setup->odr_hz, setup->low_pass)) {
        return GC_E_ARGUMENT;
    }
    if (port->spi != NULL && part->spi[0] == NULL) {
        return GC_E_NO_SPI;
    }
    for (size_t die = 0; die < 2u; die++) {
        sensor->spi[die] = port->spi != NULL ? part->spi[die] : NULL;
    }
    sensor->part = part;
    sensor->port = port;
    sensor->address = address;
    sensor->odr = odr;
    sensor->range = range;
    sensor->accel = accel;
    sensor->low_pass = setup->low_pass;
    sensor->odr_hz = setup->odr_hz;
    sensor->full_scale_dps = setup->full_scale_dps;
    sensor->lsb_dps = range->lsb_dps;
    sensor->lsb_g = part->lsb_g * accel->g / part->accel[0].g;
    sensor->data_wait = false;
    sensor->stamps = (gc_stamps_t){.known = false};
    const int error = part->set_up(sensor);
    sensor->batch = 0;
    sensor->config_checked_us = port->now_us(port->context);
    sensor->fresh_us = sensor->config_checked_us;
    return error;
}

int gc_sensor_self_test(gc_sensor_t *sensor, gc_self_test_t *result) {
    const gc_part_t *part = sensor->part;
    *result = (gc_self_test_t){.rest_most_dps = NAN};
    for (size_t i = 0; i < 3u; i++) {
        result->change_dps[i] = result->least_dps[i] = result->most_dps[i] = result->rest_dps[i] = NAN;
    }
    const int error = part->self_test != NULL ? part->self_test(sensor, result) : GC_E_NO_SELF_TEST;
    return error == GC_OK && !result->passed ? part->identify(sensor) : error; /* it may have gone */
}

/* Judges whether data stay away for too long, and finds the reason. */
static int judge_silence(gc_sensor_t *sensor, uint64_t now_us) {
    const double silent_us = now_us > sensor->fresh_us ? (double)(now_us - sensor->fresh_us) : 0.0;
    if (silent_us <= STALE_PERIODS * sensor->period_us) {
        return GC_OK;
    }
    const int error = gc_sensor_check_config(sensor, GC_E_CONFIG_LOST);
    return error != GC_OK ? error : GC_E_STALE;
}

static int check_now_and_then(gc_sensor_t *sensor, uint64_t now_us) {
    if (now_us - sensor->config_checked_us < GC_SENSOR_CONFIG_CHECK_US) {
        return GC_OK;
    }
    sensor->config_checked_us = now_us;
    return gc_sensor_check_config(sensor, GC_E_CONFIG_LOST);
}

/* On SPI a part that has gone is not missed by the bus: its readings are all zeros or all ones. */
static int check_presence(gc_sensor_t *sensor, const gc_sample_t *sample) {
    const int16_t first = sample->gyro[0];
    bool alike = first == 0 || first == -1;
    for (size_t i = 0; i < 3u; i++) {
        alike = alike && sample->gyro[i] == first && sample->acc[i] == first;
    }
    return alike && sensor->spi[0] != NULL ? gc_sensor_check_config(sensor, GC_E_CONFIG_LOST) : GC_OK;
}

int gc_sensor_ready(gc_sensor_t *sensor) {
    const gc_port_t *port = sensor->port;
    const uint64_t now_us = port->now_us(port->context);
    const int ready = sensor->part->ready(sensor);
    sensor->looked_us = port->bus_us != NULL ? port->bus_us(port->context) : now_us;
    return ready;
}

int gc_sensor_read(gc_sensor_t *sensor, gc_sample_t *sample) {
    const uint64_t now_us = sensor->port->now_us(sensor->port->context);
    const int ready = gc_sensor_ready(sensor);
    if (ready < 0) {
        return ready;
    }
    int error;
    sample->fresh = ready == 1;
    if (sample->fresh) {
        error = sensor->part->read(sensor, sample);
        error = error == GC_OK ? check_presence(sensor, sample) : error;
        /* Data that come from here on are new, however long the set-up took. */
        sensor->fresh_us = sensor->port->now_us(sensor->port->context);
    } else {
        error = judge_silence(sensor, now_us);
    }
    return error == GC_OK ? check_now_and_then(sensor, now_us) : error;
}

int gc_sensor_fifo_begin(gc_sensor_t *sensor, unsigned batch) {
    if (batch == 0u || batch > sensor->part->batch_max) {
        return GC_E_ARGUMENT;
    }
    sensor->batch = batch;
    return sensor->part->fifo_begin(sensor);
}

int gc_sensor_fifo_read(gc_sensor_t *sensor, gc_batch_t *batch) {
    batch->n = 0;
    batch->left = 0;
    batch->overrun = false;
    batch->gap = false;
    batch->stamps = 0;
    batch->lost_known = false;
    batch->lost = 0;
    int error = sensor->part->fifo_read(sensor, batch);
    if (error == GC_OK && batch->n > 0u) {
        error = check_presence(sensor, &batch->sample[batch->n - 1u]);
    }
    if (error == GC_OK) {
        error = judge_silence(sensor, batch->t_us);
    }
    return error == GC_OK ? check_now_and_then(sensor, batch->t_us) : error;
}
