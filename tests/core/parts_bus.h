/* A bus with one emulated part, for the programs that test drivers and parts: each check prints the part's name and its own if it fails. */
#ifndef PARTS_BUS_H
#define PARTS_BUS_H

#include "emul.h"
#include "emul_spi.h"
#include "gc_bmi270.h"
#include "gc_device.h"
#include "gc_error.h"
#include "gc_parts.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static uint64_t now;
static emul_t emul;
static int failures;
static bool by_spi(void);
static int refuse_writes_to = -1;
static char said[65536];
static size_t n_said;

#define CHECK(condition)                                                            \
    do {                                                                            \
        if (!(condition)) {                                                         \
            printf("%s by %s, line %d: %s\n", emul.kind->name, by_spi() ? "SPI" : "I2C", __LINE__, #condition); \
            failures++;                                                             \
        }                                                                           \
    } while (0)

static int bus_write(void *context, uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
    (void)context;
    now += 70;
    return emul_is_at(&emul, address) && reg == refuse_writes_to ? (int)n : emul_write(&emul, now, address, reg, data, n);
}

static int bus_read(void *context, uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
    (void)context;
    now += 70;
    return emul_read(&emul, now, address, reg, data, n);
}

static int spi(void *context, unsigned die, const gc_spi_t *how, const uint8_t *out, size_t n_out, uint8_t *in, size_t n_in) {
    (void)context;
    now += 20;
    if (out[0] != refuse_writes_to) {
        emul_spi(&emul, now, die, how->mode, how->most_hz, out, n_out, in, n_in);
    }
    return 0;
}

static uint64_t now_us(void *context) {
    (void)context;
    return now;
}

static void wait_until_us(void *context, uint64_t t_us) {
    (void)context;
    now = t_us > now ? t_us : now;
}

static int send_text(void *context, const char *data, size_t n) {
    (void)context;
    if (n_said + n < sizeof said) {
        memcpy(said + n_said, data, n);
        n_said += n;
        said[n_said] = '\0';
    }
    return (int)n;
}

static const uint8_t *part_file(void *context, const char *part, size_t *n) {
    (void)context;
    return emul_part_file(part, n);
}

static gc_port_t port = {.bus_write = bus_write, .bus_read = bus_read, .now_us = now_us, .wait_until_us = wait_until_us,
                         .send = send_text, .part_file = part_file};

static bool by_spi(void) {
    return port.spi != NULL;
}

static void choose_bus(bool is_spi) {
    port.spi = is_spi ? spi : NULL;
    port.bus_write = is_spi ? NULL : bus_write;
    port.bus_read = is_spi ? NULL : bus_read;
}

/* 22 degC, 40, -60 and 100 dps, 0.5, -0.75 and 1 g. */
static const int16_t world[EMUL_WORDS] = {-768, 4571, -6857, 11429, 8197, -12295, 16393};
static const double dps[3] = {4571 * 0.00875, -6857 * 0.00875, 11429 * 0.00875};
static const double g[3] = {8197 * 0.000061, -12295 * 0.000061, 16393 * 0.000061};

static void set_faults(bool nack, bool wrong_id, bool stale, bool stuck_reset) {
    const emul_faults_t faults = {.nack = nack, .wrong_id = wrong_id, .stale = stale, .stuck_reset = stuck_reset};
    emul_set_faults(&emul, &faults);
}

static void power(double clock) {
    now = 0;
    emul_power_on(&emul, clock, now, 250.0);
    emul_feed(&emul, now, world);
    now = 100000;
}

static int set_up(gc_sensor_t *imu, const gc_part_t *part, double odr_hz, double full_scale_dps, double clock) {
    power(clock);
    return gc_sensor_init(imu, part, &port, emul.kind->address, &(gc_setup_t){.odr_hz = odr_hz, .full_scale_dps = full_scale_dps});
}

#endif
