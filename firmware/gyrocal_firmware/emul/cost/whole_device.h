/* One sample through the whole device, with CALIBRATION, NETWORK and STREAM. The bus and the board take no time. */
#include "cost.h"
#include "weights.h"

#include "gc_device.h"
#include "gc_lsm6dso.h"

#include <string.h>

const unsigned cost_times = 1000;

static gc_device_t device;
static uint8_t reg[128];
static uint64_t t_us;
static int16_t rate;

static int bus_write(void *context, uint8_t address, uint8_t at, const uint8_t *data, size_t n) {
    (void)context;
    (void)address;
    memcpy(reg + at, data, n);
    reg[GC_LSM6DSO_CTRL3_C] &= (uint8_t)~GC_LSM6DSO_CTRL3_SW_RESET;
    return (int)n;
}

static int bus_read(void *context, uint8_t address, uint8_t at, uint8_t *data, size_t n) {
    (void)context;
    (void)address;
    memcpy(data, reg + at, n);
    return (int)n;
}

static uint64_t now_us(void *context) {
    (void)context;
    return t_us;
}

static void wait_until_us(void *context, uint64_t until_us) {
    (void)context;
    t_us = until_us > t_us ? until_us : t_us;
}

static int send(void *context, const char *data, size_t n) {
    (void)context;
    (void)data;
    return (int)n;
}

static void command(const char *text) {
    gc_device_receive(&device, text, strlen(text));
}

void cost_prepare(void) {
    static const gc_port_t port = {
        .bus_write = bus_write, .bus_read = bus_read, .now_us = now_us, .wait_until_us = wait_until_us, .send = send};
    static const gc_device_config_t config = {
        .port = &port, .part = &gc_lsm6dso, .address = GC_LSM6DSO_ADDRESS, .calibration = CALIBRATION, .net = NETWORK};
    reg[GC_LSM6DSO_WHO_AM_I] = GC_LSM6DSO_ID;
    reg[GC_LSM6DSO_STATUS] = 7;
    gc_device_init(&device, &config);
    command("stream " STREAM "\nstart up\n");
    rate = 8950;
    for (unsigned i = 0; i < 1000u; i++) {
        cost_act();
    }
    command("stop\nstart down\n");
    rate = -8950;
}

void cost_act(void) {
    static unsigned noise;
    noise = (noise * 13u + 5u) % 64u;
    const uint16_t gz = (uint16_t)(rate + (int16_t)noise);
    reg[GC_LSM6DSO_OUT_TEMP_L + 6] = (uint8_t)(gz & 0xFFu);
    reg[GC_LSM6DSO_OUT_TEMP_L + 7] = (uint8_t)(gz >> 8);
    gc_device_step(&device);
}
