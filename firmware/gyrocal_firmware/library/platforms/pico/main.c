/* The calibrator on a Raspberry Pi Pico: sensor on I2C0, SDA GP4 (pin 6), SCL GP5 (pin 7); text over USB. It keeps nothing over
   power-off. A reader who is not there costs nothing: what the USB does not take at once is dropped, and the device counts it. */
#include "gc_device.h"
#include "gc_parts.h"
#include "headers.h"

#include "hardware/gpio.h"
#include "hardware/i2c.h"
#include "hardware/watchdog.h"
#include "pico/stdlib.h"
#include "pico/stdio_usb.h"

#include <stdio.h>
#include <string.h>

#define BUS i2c0
#define SDA 4
#define SCL 5
#define BUS_HZ 400000
#define TRANSFER_US 10000u
#define LONGEST_WRITE 64u

static int bus_write(void *context, uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
    uint8_t bytes[LONGEST_WRITE + 1u];
    (void)context;
    if (n > LONGEST_WRITE) {
        return -1;
    }
    bytes[0] = reg;
    memcpy(bytes + 1, data, n);
    const int sent = i2c_write_timeout_us(BUS, address, bytes, n + 1u, false, TRANSFER_US);
    return sent == (int)(n + 1u) ? (int)n : -1;
}

static int bus_read(void *context, uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
    (void)context;
    if (i2c_write_timeout_us(BUS, address, &reg, 1, true, TRANSFER_US) != 1) {
        return -1;
    }
    return i2c_read_timeout_us(BUS, address, data, n, false, TRANSFER_US);
}

static uint64_t now_us(void *context) {
    (void)context;
    return time_us_64();
}

static void wait_until_us(void *context, uint64_t t_us) {
    (void)context;
    const uint64_t now = time_us_64();
    if (t_us > now) {
        sleep_us(t_us - now);
    }
}

static int send(void *context, const char *data, size_t n) {
    (void)context;
    return stdio_usb_connected() ? (int)fwrite(data, 1, n, stdout) : -1;
}

static void restart(void *context) {
    (void)context;
    sleep_ms(100);
    watchdog_reboot(0, 0, 0);
}

static const uint8_t *part_file(void *context, const char *part, size_t *n) {
    (void)context;
    (void)part;
    *n = gyrocal_part_file_bytes;
    return gyrocal_part_file;
}

static const gc_port_t port = {.bus_write = bus_write, .bus_read = bus_read, .now_us = now_us, .wait_until_us = wait_until_us,
                               .send = send, .restart = restart, .part_file = part_file};

int main(void) {
    static gc_device_config_t config;
    static gc_device_t device;
    const gc_part_t *found;
    stdio_init_all();
    stdio_set_translate_crlf(&stdio_usb, false);
    i2c_init(BUS, BUS_HZ);
    gpio_set_function(SDA, GPIO_FUNC_I2C);
    gpio_set_function(SCL, GPIO_FUNC_I2C);
    gpio_pull_up(SDA);
    gpio_pull_up(SCL);
    sleep_ms(100); /* start-up time of the slowest sensor */
    config.port = &port;
    config.parts = gc_parts;
    config.address = gc_part_look(gc_parts, &port, &found);
    config.calibration = gyrocal_calibration;
    config.net = gyrocal_net;
    gc_device_init(&device, &config);
    for (;;) {
        int got;
        while ((got = getchar_timeout_us(0)) >= 0) {
            const char byte = (char)got;
            gc_device_receive(&device, &byte, 1);
        }
        gc_device_step(&device);
    }
}
