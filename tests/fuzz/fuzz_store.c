/* Records of flash with the right check sum and any content: the device starts, tells only well-formed sentences, and what it
   corrects by is finite. */
#include "calibration.h"
#include "emul_lsm6dso.h"
#include "gc_device.h"
#include "gc_error.h"
#include "gc_lsm6dso.h"
#include "weights.h"

#include "fuzz.h"

static uint64_t now;
static emul_lsm6dso_t chip;
static gc_device_t device;
static fuzz_input_t in;

static int bus_write(void *context, uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
    (void)context;
    (void)address;
    now += 100;
    return emul_lsm6dso_write(&chip, now, reg, data, n);
}

static int bus_read(void *context, uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
    (void)context;
    (void)address;
    now += 100;
    return emul_lsm6dso_read(&chip, now, reg, data, n);
}

static uint64_t now_us(void *context) {
    (void)context;
    return now;
}

static void wait_until_us(void *context, uint64_t t_us) {
    (void)context;
    now = t_us > now ? t_us : now;
    emul_lsm6dso_advance(&chip, now);
}

static int send(void *context, const char *data, size_t n) {
    gc_message_t m;
    (void)context;
    fuzz_must(data[0] == '>' || gc_wire_parse(data, n, &m) == GC_OK, "a malformed sentence");
    return (int)n;
}

static int store(void *context, const char *key, const void *data, size_t n) {
    (void)context;
    (void)key;
    (void)data;
    return n > 0u ? 0 : -1;
}

/* What was a whole record of this size and version, with content from the input over it. */
static int load(void *context, const char *key, void *data, size_t n) {
    gc_record_t *record = data;
    uint8_t *byte = data;
    (void)context;
    memset(data, 0, n);
    record->version = 1u + fuzz_byte(&in) % 4u;
    record->n = (uint32_t)n;
    record->sequence = 2u + (key[strlen(key) - 1u] == 'b');
    if (n > sizeof *record) {
        const unsigned patches = fuzz_byte(&in) % 32u;
        for (unsigned k = 0; k < patches; k++) {
            uint16_t at;
            fuzz_take(&in, &at, sizeof at);
            const size_t i = sizeof *record + at % (n - sizeof *record);
            const size_t room = n - i < 8u ? n - i : 8u;
            fuzz_take(&in, byte + i, room);
        }
    }
    record->crc = gc_crc32(0, byte + sizeof record->crc, n - sizeof record->crc);
    return (int)n;
}

static void command(const char *text) {
    gc_device_receive(&device, text, strlen(text));
    for (unsigned k = 0; k < 40u; k++) {
        gc_device_step(&device);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n) {
    static const gc_port_t port = {.bus_write = bus_write, .bus_read = bus_read, .now_us = now_us,
                                   .wait_until_us = wait_until_us, .send = send, .store = store, .load = load};
    static const gc_device_config_t config = {
        .port = &port, .part = &gc_lsm6dso, .address = GC_LSM6DSO_ADDRESS, .calibration = &gc_calibration, .net = &gc_net};
    in = (fuzz_input_t){.data = data, .n = n};
    now = 0;
    emul_lsm6dso_power_on(&chip, now, 250.0);
    gc_device_init(&device, &config);
    for (unsigned axis = 0; axis < 3u; axis++) {
        const double corrected = gc_kept_corrected(&device.kept, axis, 78.0);
        fuzz_must(corrected - corrected == 0.0 || corrected != corrected, "a corrected rate that is infinite");
    }
    command("status\n");
    command("dump\n");
    command("stream corrected\n");
    command("undo\n");
    command("start up\nstop\n");
    command("get\n");
    return 0;
}
