/* The calibrator with Zephyr: the sensor of the node "gyrocal,gyroscope" on a bus of I2C or SPI, text over the chosen console's UART. It keeps nothing over
   power-off. */
#include "gc_device.h"
#include "gc_error.h"
#include "gc_parts.h"
#include "headers.h"

#include <zephyr/device.h>
#include <zephyr/devicetree.h>
#include <zephyr/drivers/gpio.h>
#include <zephyr/drivers/i2c.h>
#include <zephyr/drivers/spi.h>
#include <zephyr/drivers/uart.h>
#include <zephyr/kernel.h>
#include <zephyr/sys/reboot.h>
#include <zephyr/sys/ring_buffer.h>

#define NODE DT_COMPAT_GET_ANY_STATUS_OKAY(gyrocal_gyroscope)
#define OUT_BYTES 8192
#define IN_BYTES 256

static const struct gpio_dt_spec int_pin = GPIO_DT_SPEC_GET_OR(NODE, int_gpios, {0});
static const struct device *const uart = DEVICE_DT_GET(DT_CHOSEN(zephyr_console));
RING_BUF_DECLARE(out, OUT_BYTES);
RING_BUF_DECLARE(in, IN_BYTES);

#if DT_ON_BUS(NODE, spi)

static const struct spi_dt_spec sensor = SPI_DT_SPEC_GET(NODE, SPI_WORD_SET(8) | SPI_TRANSFER_MSB, 0);
#define ADDRESS 0 /* there is none on SPI */

/* A driver of Zephyr takes a configuration at another address for another one. */
static int transfer(void *context, unsigned die, const gc_spi_t *how, const uint8_t *out, size_t n_out, uint8_t *in, size_t n_in) {
    static struct spi_config configs[2];
    static unsigned used;
    ARG_UNUSED(context);
    struct spi_config now = sensor.config;
    now.frequency = MIN(now.frequency, how->most_hz);
    now.operation |= ((how->mode & 2u) != 0u ? SPI_MODE_CPOL : 0u) | ((how->mode & 1u) != 0u ? SPI_MODE_CPHA : 0u);
    if (now.frequency != configs[used].frequency || now.operation != configs[used].operation) {
        used = 1u - used;
        configs[used] = now;
    }
    const struct spi_buf sent[] = {{.buf = (void *)out, .len = n_out}};
    const struct spi_buf got[] = {{.buf = NULL, .len = n_out}, {.buf = in, .len = n_in}};
    const struct spi_buf_set tx = {.buffers = sent, .count = 1}, rx = {.buffers = got, .count = 2};
    return die == 0u && spi_transceive(sensor.bus, &configs[used], &tx, n_in > 0u ? &rx : NULL) == 0 ? 0 : -1;
}

#define BY_BUS .spi = transfer

#else

static const struct i2c_dt_spec sensor = I2C_DT_SPEC_GET(NODE);
#define ADDRESS ((uint8_t)sensor.addr)

static int bus_write(void *context, uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
    ARG_UNUSED(context);
    return i2c_burst_write(sensor.bus, address, reg, data, (uint32_t)n) == 0 ? (int)n : -1;
}

static int bus_read(void *context, uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
    ARG_UNUSED(context);
    return i2c_burst_read(sensor.bus, address, reg, data, (uint32_t)n) == 0 ? (int)n : -1;
}

#define BY_BUS .bus_write = bus_write, .bus_read = bus_read

#endif

static uint64_t now_us(void *context) {
    ARG_UNUSED(context);
    return k_ticks_to_us_floor64((uint64_t)k_uptime_ticks());
}

static void wait_until_us(void *context, uint64_t t_us) {
    const uint64_t now = now_us(context);
    if (t_us > now) {
        k_usleep((int32_t)(t_us - now));
    }
}

/* Looked at, not waited for: the pin of a sensor stays high until its data are read. */
static uint64_t wait_ready_us(void *context, uint64_t deadline_us) {
    while (gpio_pin_get_dt(&int_pin) <= 0 && now_us(context) < deadline_us) {
        k_usleep(100);
    }
    return 0;
}

static void on_uart(const struct device *dev, void *unused) {
    uint8_t bytes[64];
    ARG_UNUSED(unused);
    while (uart_irq_update(dev) && uart_irq_is_pending(dev)) {
        if (uart_irq_rx_ready(dev)) {
            const int n = uart_fifo_read(dev, bytes, sizeof bytes);
            (void)ring_buf_put(&in, bytes, n > 0 ? (uint32_t)n : 0u);
        }
        if (uart_irq_tx_ready(dev)) {
            uint8_t *waiting;
            const uint32_t n = ring_buf_get_claim(&out, &waiting, sizeof bytes);
            const int sent = n > 0u ? uart_fifo_fill(dev, waiting, (int)n) : 0;
            (void)ring_buf_get_finish(&out, sent > 0 ? (uint32_t)sent : 0u);
            if (n == 0u) {
                uart_irq_tx_disable(dev);
            }
        }
    }
}

static int send(void *context, const char *data, size_t n) {
    ARG_UNUSED(context);
    const unsigned int key = irq_lock();
    const bool fits = ring_buf_space_get(&out) >= n;
    if (fits) {
        (void)ring_buf_put(&out, (const uint8_t *)data, (uint32_t)n);
    }
    irq_unlock(key);
    uart_irq_tx_enable(uart);
    return fits ? (int)n : -1;
}

static void restart(void *context) {
    ARG_UNUSED(context);
    k_msleep(100);
    sys_reboot(SYS_REBOOT_COLD);
}

static const uint8_t *part_file(void *context, const char *part, size_t *n) {
    ARG_UNUSED(context);
    ARG_UNUSED(part);
    *n = gyrocal_part_file_bytes;
    return gyrocal_part_file;
}

int main(void) {
    static gc_port_t port = {BY_BUS, .now_us = now_us, .wait_until_us = wait_until_us, .send = send,
                             .restart = restart, .part_file = part_file};
    static gc_device_config_t config;
    static gc_device_t device;
    if (int_pin.port != NULL && gpio_pin_configure_dt(&int_pin, GPIO_INPUT) == 0) {
        port.wait_ready_us = wait_ready_us;
    }
    uart_irq_callback_set(uart, on_uart);
    uart_irq_rx_enable(uart);
    k_msleep(100); /* start-up time of the slowest sensor */
    config.port = &port;
    config.parts = gc_parts;
    config.address = ADDRESS;
    config.calibration = gyrocal_calibration;
    config.net = gyrocal_net;
    gc_device_init(&device, &config);
    for (;;) {
        uint8_t data[64];
        const uint32_t n = ring_buf_get(&in, data, sizeof data);
        gc_device_receive(&device, (const char *)data, n);
        gc_device_step(&device);
    }
    return 0;
}
