/* A sensor whose registers and FIFO hold any bytes, on a bus that fails at random: no crash, an end to each step, and sentences
   that are well formed. */
#include "calibration.h"
#include "gc_device.h"
#include "gc_error.h"
#include "gc_lsm6dso.h"
#include "weights.h"

#include "fuzz.h"

#define FIFO_DATA_OUT_TAG 0x78
#define MOST_TRANSFERS 20000u /* of one input: a device that reads for ever would be caught */

static uint64_t now;
static gc_device_t device;
static fuzz_input_t in;
static uint8_t written[256];
static unsigned transfers;

static int bus_write(void *context, uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
    (void)context;
    (void)address;
    now += 100;
    for (size_t i = 0; i < n; i++) {
        written[(uint8_t)(reg + i)] = data[i];
    }
    return fuzz_byte(&in) == 0xFFu ? -1 : 0;
}

/* Mostly what a sound part would answer, so that the driver gets beyond its set-up; else the next bytes of the input. */
static int bus_read(void *context, uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
    (void)context;
    (void)address;
    now += 100;
    fuzz_must(++transfers < MOST_TRANSFERS, "a device that does not stop reading");
    const uint8_t luck = fuzz_byte(&in);
    if (luck == 0xFFu) {
        return -1;
    }
    for (size_t i = 0; i < n; i++) {
        const uint8_t at = (uint8_t)(reg + i);
        const int data_register = at >= GC_LSM6DSO_STATUS && (at < 0x60 || at >= FIFO_DATA_OUT_TAG);
        data[i] = at == GC_LSM6DSO_WHO_AM_I ? GC_LSM6DSO_ID
                  : data_register || luck > 0xF0u ? fuzz_byte(&in)
                                                  : (uint8_t)(written[at] & (at == GC_LSM6DSO_CTRL3_C ? 0xFEu : 0xFFu));
    }
    return luck == 0xFEu ? (int)n - 1 : (int)n;
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
    gc_message_t m;
    (void)context;
    if (data[0] == '\0') {
        fuzz_must(n <= GC_PACK_FRAME_MAX && memchr(data + 1, 0, n - 1u) == data + n - 1u, "a malformed frame");
        return (int)n;
    }
    fuzz_must(data[0] == '>' || gc_wire_parse(data, n, &m) == GC_OK, "a malformed sentence");
    return (int)n;
}

static void command(const char *text, unsigned steps) {
    gc_device_receive(&device, text, strlen(text));
    for (unsigned k = 0; k < steps; k++) {
        gc_device_step(&device);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n) {
    static const gc_port_t port = {
        .bus_write = bus_write, .bus_read = bus_read, .now_us = now_us, .wait_until_us = wait_until_us, .send = send};
    static const gc_device_config_t config = {
        .port = &port, .part = &gc_lsm6dso, .address = GC_LSM6DSO_ADDRESS, .calibration = &gc_calibration, .net = &gc_net};
    in = (fuzz_input_t){.data = data, .n = n};
    now = 0;
    transfers = 0;
    memset(written, 0, sizeof written);
    gc_device_init(&device, &config);
    const uint8_t how = fuzz_byte(&in);
    command(how % 2u ? "set fifo 12\n" : "set fifo 0\n", 20);
    command(how / 2u % 2u ? "auto off\nstream packed\nstart up\n" : "auto off\nstream raw\nstart up\n", 60);
    command("stop\nstart down\n", 60);
    command("stop\nauto on\n", 60);
    return 0;
}
