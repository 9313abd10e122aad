/* Any bytes as commands, on a device whose bus misbehaves at random: no crash, and every sentence is well formed.
   Standalone: random words. For libFuzzer: clang -fsanitize=fuzzer -DGC_LIBFUZZER. */
#include "calibration.h"
#include "emul_lsm6dso.h"
#include "gc_device.h"
#include "gc_lsm6dso.h"
#include "gc_error.h"
#include "gc_wifi.h"
#include "weights.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);

static uint64_t now;
static emul_lsm6dso_t chip;
static gc_device_t device;
static gc_wifi_t wifi;
static const uint8_t *luck;
static size_t luck_n, luck_i;

static bool bad_luck(void) {
    return luck_n > 0 && luck[luck_i++ % luck_n] == 0xFF;
}

static int bus_write(void *context, uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
    (void)context;
    (void)address;
    now += 100;
    return bad_luck() ? -1 : emul_lsm6dso_write(&chip, now, reg, data, n);
}

static int bus_read(void *context, uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
    (void)context;
    (void)address;
    now += 100;
    return bad_luck() ? (int)luck_i % 2 - 1 : emul_lsm6dso_read(&chip, now, reg, data, n);
}

static uint64_t now_us(void *context) {
    (void)context;
    return now;
}

static void wait_until_us(void *context, uint64_t t_us) {
    (void)context;
    now = t_us > now ? t_us : now;
    chip.world[3] = (int16_t)(now * 2654435761u);
    emul_lsm6dso_advance(&chip, now);
}

static int send(void *context, const char *data, size_t n) {
    gc_message_t m;
    (void)context;
    if (data[0] != '>' && gc_wire_parse(data, n, &m) != GC_OK) {
        fprintf(stderr, "fuzz_device: sent %.*s", (int)n, data);
        abort();
    }
    return bad_luck() ? -1 : (int)n;
}

static int obey_wifi(void *context, gc_wifi_word_t word, const char *text, size_t n) {
    (void)context;
    const int error = gc_wifi_set(&wifi, word, (gc_text_t){text, n});
    if (wifi.name[sizeof wifi.name - 1u] != '\0' || wifi.password[sizeof wifi.password - 1u] != '\0' ||
        wifi.token[sizeof wifi.token - 1u] != '\0') {
        fprintf(stderr, "fuzz_device: a text of wifi without its end\n");
        abort();
    }
    return error;
}

static void tell_wifi(void *context, gc_wifi_state_t *state) {
    (void)context;
    state->state = wifi.on != 0u ? "joining" : "off";
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n) {
    static const gc_port_t port = {.bus_write = bus_write, .bus_read = bus_read, .now_us = now_us, .wait_until_us = wait_until_us,
                                   .send = send, .wifi = obey_wifi, .wifi_state = tell_wifi};
    static const gc_device_config_t config = {
        .port = &port, .part = &gc_lsm6dso, .address = GC_LSM6DSO_ADDRESS, .calibration = &gc_calibration, .net = &gc_net};
    memset(&wifi, 0, sizeof wifi);
    now = 0;
    luck = data;
    luck_n = n;
    luck_i = 0;
    emul_lsm6dso_power_on(&chip, now, 250.0);
    gc_device_init(&device, &config);
    for (size_t i = 0; i < n; i++) {
        gc_device_receive(&device, (const char *)data + i, 1);
        if (data[i] == '\n') {
            for (int k = 0; k < 40; k++) {
                gc_device_step(&device);
            }
        }
    }
    return 0;
}

#ifndef GC_LIBFUZZER
static const char *const words[] = {
    "start up", "start down", "stop", "hello", "status", "auto on", "auto off", "stream raw", "stream teleplot",
    "stream off", "reset", "set rate_hz 145", "set rate_hz 104", "set rate_hz 1e9", "set rate_hz", "set axis x",
    "set fifo 16", "set fifo 0", "set fifo 999",
    "set axis q", "set table_dps none", "set table_dps -78", "set table_dps 0", "set turn_deg 360", "set turn_deg 0",
    "set full_scale_dps 2000", "set full_scale_dps 3", "get axis", "get table_dps", "get", "stream corrected", "dump", "undo",
    "set accel_g 8", "set accel_g 5", "set low_pass 2", "set low_pass 9",
    "selftest", "reboot", "set sensor auto", "wifi", "wifi name my net", "wifi password  a b c d e f", "wifi token m5Qb0Xw2r_K7-tYz",
    "wifi on", "wifi off", "wifi forget", "wifi token", "wifi x", "wifi name ", "x x x x x x", "", "\xff", "\xff\xff",
};

int main(int argc, char **argv) {
    const long rounds = argc > 1 ? atol(argv[1]) : 300;
    uint64_t state = 88172645463325252u;
    for (long k = 0; k < rounds; k++) {
        uint8_t data[1024];
        size_t n = 0;
        while (n < 900) {
            state = state * 6364136223846793005u + 1442695040888963407u;
            const char *word = words[(state >> 33) % (sizeof words / sizeof words[0])];
            memcpy(data + n, word, strlen(word));
            n += strlen(word);
            data[n++] = (uint8_t)((state >> 60) == 0 ? state >> 20 : '\n');
        }
        (void)LLVMFuzzerTestOneInput(data, n);
    }
    return 0;
}
#endif
