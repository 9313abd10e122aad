/* The calibrator on a Raspberry Pi Pico: sensor on I2C0, SDA GP4 (pin 6), SCL GP5 (pin 7), or with GYROCAL_SPI on SPI0, SCK GP18
   (pin 24), MOSI GP19 (25), MISO GP16 (21), CS GP17 (22), that of a BMI088's accelerometer GP20 (26); text over USB. It keeps
   nothing over power-off. A reader who is not there costs nothing: what the USB does not take at once is dropped, and the device counts it. */
#include "gc_device.h"
#include "gc_parts.h"
#include "headers.h"

#include "hardware/gpio.h"
#include "hardware/i2c.h"
#include "hardware/spi.h"
#include "hardware/watchdog.h"
#include "pico/stdlib.h"
#include "pico/stdio_usb.h"

#include <stdio.h>
#include <string.h>

#if GYROCAL_SPI

#define BUS spi0
#define SCK 18
#define MOSI 19
#define MISO 16
#define BUS_HZ 8000000u /* at most; slower where the wires are long */

static const uint selects[] = {17, 20}; /* of both dies */

static int transfer(void *context, unsigned die, const gc_spi_t *how, const uint8_t *out, size_t n_out, uint8_t *in, size_t n_in) {
    (void)context;
    (void)spi_set_baudrate(BUS, how->most_hz < BUS_HZ ? how->most_hz : BUS_HZ);
    spi_set_format(BUS, 8, (how->mode & 2u) != 0u ? SPI_CPOL_1 : SPI_CPOL_0, (how->mode & 1u) != 0u ? SPI_CPHA_1 : SPI_CPHA_0,
                   SPI_MSB_FIRST);
    gpio_put(selects[die], false);
    (void)spi_write_blocking(BUS, out, n_out);
    (void)spi_read_blocking(BUS, 0, in, n_in);
    gpio_put(selects[die], true);
    return 0;
}

static void begin_bus(void) {
    spi_init(BUS, BUS_HZ);
    gpio_set_function(SCK, GPIO_FUNC_SPI);
    gpio_set_function(MOSI, GPIO_FUNC_SPI);
    gpio_set_function(MISO, GPIO_FUNC_SPI);
    for (unsigned die = 0; die < 2u; die++) {
        gpio_init(selects[die]);
        gpio_put(selects[die], true);
        gpio_set_dir(selects[die], GPIO_OUT);
    }
}

#define BY_BUS .spi = transfer

#else

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

static void begin_bus(void) {
    i2c_init(BUS, BUS_HZ);
    gpio_set_function(SDA, GPIO_FUNC_I2C);
    gpio_set_function(SCL, GPIO_FUNC_I2C);
    gpio_pull_up(SDA);
    gpio_pull_up(SCL);
}

#define BY_BUS .bus_write = bus_write, .bus_read = bus_read

#endif

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

static const gc_port_t port = {BY_BUS, .now_us = now_us, .wait_until_us = wait_until_us, .send = send,
                               .restart = restart, .part_file = part_file};

int main(void) {
    static gc_device_config_t config;
    static gc_device_t device;
    const gc_part_t *found;
    stdio_init_all();
    stdio_set_translate_crlf(&stdio_usb, false);
    begin_bus();
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
