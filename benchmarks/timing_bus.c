/* What one sample of each part takes on its bus, and how many the FIFO holds: the drivers against the emulated parts, transfers counted.
 * A line a part: name, looks and reading of a single sample in bits, a batch of 16 in bits a sample (0 = no FIFO), samples in a full
 * FIFO, the check of the settings in bits, set-up in bits, and a sample of a batch beyond GC_FIFO_ALONE_HZ in bits (0 = no such rate). */
#include "emul.h"
#include "gc_error.h"
#include "gc_parts.h"

#include <stdio.h>

#define BATCH 16u

static uint64_t now;
static emul_t emul;
static unsigned long bits;

static int bus_write(void *context, uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
    (void)context;
    bits += 9u * (n + 2u) + 2u; /* address, register, data; start and stop */
    return emul_write(&emul, now, address, reg, data, n);
}

static int bus_read(void *context, uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
    (void)context;
    bits += 9u * (n + 3u) + 3u; /* address, register, address, data; two starts and a stop */
    return emul_read(&emul, now, address, reg, data, n);
}

static uint64_t now_us(void *context) {
    (void)context;
    return now;
}

static void wait_until_us(void *context, uint64_t t_us) {
    (void)context;
    now = t_us > now ? t_us : now;
}

static int send(void *context, const char *data, size_t n) {
    (void)context;
    (void)data;
    return (int)n;
}

static const uint8_t *part_file(void *context, const char *part, size_t *n) {
    (void)context;
    return emul_part_file(part, n);
}

static const gc_port_t port = {
    .bus_write = bus_write, .bus_read = bus_read, .now_us = now_us, .wait_until_us = wait_until_us, .send = send, .part_file = part_file};

static unsigned long since(unsigned long *before) {
    const unsigned long spent = bits - *before;
    *before = bits;
    return spent;
}

static gc_batch_t batch;
static unsigned long mark;

static int begin(gc_sensor_t *sensor, const gc_part_t *part, const emul_kind_t *kind, double odr_hz) {
    const gc_setup_t setup = {.odr_hz = odr_hz, .full_scale_dps = 250.0};
    emul.kind = kind;
    now = 0;
    emul_power_on(&emul, 1.0, now, 250.0);
    now = 200000;
    mark = bits = 0;
    return gc_sensor_init(sensor, part, &port, kind->address, &setup);
}

/* Bits of one sample of a batch; the check of the settings is left out. */
static unsigned long batched(gc_sensor_t *sensor, double period_us) {
    unsigned n = 0;
    if (sensor->part->batch_max == 0u || gc_sensor_fifo_begin(sensor, BATCH) != GC_OK) {
        return 0;
    }
    now += (uint64_t)(2.0 * BATCH * period_us);
    (void)gc_sensor_fifo_read(sensor, &batch);
    (void)since(&mark);
    for (int k = 0; k < 32; k++) {
        now += (uint64_t)(BATCH * period_us);
        sensor->config_checked_us = now;
        (void)gc_sensor_fifo_read(sensor, &batch);
        n += batch.n;
    }
    return since(&mark) / n;
}

static unsigned held(gc_sensor_t *sensor, double period_us) {
    unsigned depth = 0;
    now += (uint64_t)(2000.0 * period_us);
    do {
        (void)gc_sensor_fifo_read(sensor, &batch);
        depth += batch.n;
    } while (batch.left > 0u);
    return depth;
}

/* At the slowest of such rates: this bus carries no other. */
static unsigned long gyro_alone(const gc_part_t *part, const emul_kind_t *kind) {
    gc_sensor_t sensor;
    size_t i = 0;
    while (i < part->odrs && part->odr[i].hz <= GC_FIFO_ALONE_HZ) {
        i++;
    }
    const bool has_one = part->batch_max > 0u && i < part->odrs;
    return has_one && begin(&sensor, part, kind, part->odr[i].hz) == GC_OK ? batched(&sensor, 1e6 * (1.0 + 1e-3) / part->odr[i].hz) : 0;
}

int main(void) {
    size_t i = 0;
    for (const emul_kind_t *kind = emul_kinds; kind->name != NULL; kind++, i++) {
        const gc_part_t *part = gc_parts[i];
        const gc_odr_t *odr = &part->odr[part->odrs / 2u];
        const double period_us = 1e6 * (1.0 + 1e-3) / odr->hz;
        gc_sensor_t sensor;
        gc_sample_t sample;
        if (begin(&sensor, part, kind, odr->hz) != GC_OK) {
            return 1;
        }
        const unsigned long set_up = since(&mark);
        now += (uint64_t)(2.0 * period_us);
        (void)gc_sensor_read(&sensor, &sample);
        now += (uint64_t)(1.5 * period_us);
        (void)since(&mark);
        (void)gc_sensor_read(&sensor, &sample);
        const unsigned long single = since(&mark);
        (void)gc_sensor_check_config(&sensor, GC_E_CONFIG_LOST);
        const unsigned long check = since(&mark), fifo = batched(&sensor, period_us);
        const unsigned depth = fifo > 0u ? held(&sensor, period_us) : 0u;
        printf("%s %lu %lu %u %lu %lu %lu\n", kind->name, single, fifo, depth, check, set_up, gyro_alone(part, kind));
    }
    return 0;
}
