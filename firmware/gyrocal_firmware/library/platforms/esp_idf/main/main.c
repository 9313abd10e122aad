/* The calibrator with ESP-IDF: sensor at GPIO 21 (SDA) and 22 (SCL), or with GYROCAL_SPI at 18 (SCK), 23 (MOSI), 19 (MISO) and 5 (CS; 4
   that of a BMI088's accelerometer); text over UART0, results kept in NVS. */
#include "gc_device.h"
#include "gc_parts.h"
#include "headers.h"

#if GYROCAL_SPI
#include "driver/spi_master.h"
#include "esp_attr.h"
#else
#include "driver/i2c_master.h"
#endif
#include "driver/uart.h"
#include "esp_rom_sys.h"
#include "esp_system.h"
#include "esp_timer.h"
#include "freertos/FreeRTOS.h"
#include "freertos/task.h"
#include "nvs.h"
#include "nvs_flash.h"

#include <string.h>

#define BAUD 921600
#define TX_BYTES 8192
#define TICK_US (1000000u / configTICK_RATE_HZ)

static nvs_handle_t nvs;

#if GYROCAL_SPI

#define SCK 18
#define MOSI 23
#define MISO 19
#define BUS_HZ 8000000 /* at most; slower where the wires are long */
#define LONGEST 160u

static const int selects[] = {5, 4}; /* of both dies */
static struct {
    spi_device_handle_t handle;
    int hz;
    uint8_t mode;
} dies[2];

static bool set_up_die(unsigned die, int hz, uint8_t mode) {
    const spi_device_interface_config_t config = {
        .clock_speed_hz = hz, .mode = mode, .spics_io_num = selects[die], .queue_size = 1};
    if (dies[die].handle != NULL && dies[die].hz == hz && dies[die].mode == mode) {
        return true;
    }
    if (dies[die].handle != NULL) {
        (void)spi_bus_remove_device(dies[die].handle);
        dies[die].handle = NULL;
    }
    dies[die].hz = hz;
    dies[die].mode = mode;
    return spi_bus_add_device(SPI2_HOST, &config, &dies[die].handle) == ESP_OK;
}

static int transfer(void *context, unsigned die, const gc_spi_t *how, const uint8_t *out, size_t n_out, uint8_t *in, size_t n_in) {
    static WORD_ALIGNED_ATTR uint8_t bytes[LONGEST]; /* received where they were sent from */
    (void)context;
    spi_transaction_t all = {.length = 8u * (n_out + n_in), .tx_buffer = bytes, .rx_buffer = bytes};
    if (n_out + n_in > sizeof bytes || !set_up_die(die, how->most_hz < BUS_HZ ? (int)how->most_hz : BUS_HZ, how->mode)) {
        return -1;
    }
    memset(bytes, 0, n_out + n_in);
    memcpy(bytes, out, n_out);
    if (spi_device_polling_transmit(dies[die].handle, &all) != ESP_OK) {
        return -1;
    }
    if (n_in > 0u) {
        memcpy(in, bytes + n_out, n_in);
    }
    return 0;
}

static void begin_bus(void) {
    const spi_bus_config_t config = {
        .sclk_io_num = SCK, .mosi_io_num = MOSI, .miso_io_num = MISO, .quadwp_io_num = -1, .quadhd_io_num = -1};
    ESP_ERROR_CHECK(spi_bus_initialize(SPI2_HOST, &config, SPI_DMA_CH_AUTO));
}

#define BY_BUS .spi = transfer

#else

#define SDA 21
#define SCL 22
#define BUS_HZ 400000
#define TRANSFER_MS 10
#define LONGEST_WRITE 64u

static i2c_master_bus_handle_t bus;
static i2c_master_dev_handle_t parts[128]; /* by address */

static i2c_master_dev_handle_t part_at(uint8_t address) {
    if (parts[address] == NULL) {
        const i2c_device_config_t config = {
            .dev_addr_length = I2C_ADDR_BIT_LEN_7, .device_address = address, .scl_speed_hz = BUS_HZ};
        (void)i2c_master_bus_add_device(bus, &config, &parts[address]);
    }
    return parts[address];
}

static int bus_write(void *context, uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
    uint8_t bytes[LONGEST_WRITE + 1u];
    (void)context;
    if (n > LONGEST_WRITE) {
        return -1;
    }
    bytes[0] = reg;
    memcpy(bytes + 1, data, n);
    return i2c_master_transmit(part_at(address), bytes, n + 1u, TRANSFER_MS) == ESP_OK ? (int)n : -1;
}

static int bus_read(void *context, uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
    (void)context;
    return i2c_master_transmit_receive(part_at(address), &reg, 1, data, n, TRANSFER_MS) == ESP_OK ? (int)n : -1;
}

static void begin_bus(void) {
    const i2c_master_bus_config_t config = {.i2c_port = I2C_NUM_0, .sda_io_num = SDA, .scl_io_num = SCL,
                                            .clk_source = I2C_CLK_SRC_DEFAULT, .glitch_ignore_cnt = 7,
                                            .flags.enable_internal_pullup = true};
    ESP_ERROR_CHECK(i2c_new_master_bus(&config, &bus));
}

#define BY_BUS .bus_write = bus_write, .bus_read = bus_read

#endif

static uint64_t now_us(void *context) {
    (void)context;
    return (uint64_t)esp_timer_get_time();
}

/* Whole ticks are slept, the rest is waited for. */
static void wait_until_us(void *context, uint64_t t_us) {
    uint64_t now = now_us(context);
    if (t_us > now + 2u * TICK_US) {
        vTaskDelay((TickType_t)((t_us - now) / TICK_US - 1u));
        now = now_us(context);
    }
    if (t_us > now) {
        esp_rom_delay_us((uint32_t)(t_us - now));
    }
}

static int send(void *context, const char *data, size_t n) {
    size_t room = 0;
    (void)context;
    if (uart_get_tx_buffer_free_size(UART_NUM_0, &room) != ESP_OK || room < n + 256u) {
        return -1;
    }
    return uart_write_bytes(UART_NUM_0, data, n);
}

static int store(void *context, const char *key, const void *data, size_t n) {
    (void)context;
    return nvs_set_blob(nvs, key, data, n) == ESP_OK && nvs_commit(nvs) == ESP_OK ? 0 : -1;
}

static int load(void *context, const char *key, void *data, size_t n) {
    (void)context;
    return nvs_get_blob(nvs, key, data, &n) == ESP_OK ? (int)n : -1;
}

static void restart(void *context) {
    (void)context;
    vTaskDelay(pdMS_TO_TICKS(100));
    esp_restart();
}

static const uint8_t *part_file(void *context, const char *part, size_t *n) {
    (void)context;
    (void)part;
    *n = gyrocal_part_file_bytes;
    return gyrocal_part_file;
}

static const gc_port_t port = {BY_BUS, .now_us = now_us, .wait_until_us = wait_until_us, .send = send,
                               .store = store, .load = load, .restart = restart, .part_file = part_file};

void app_main(void) {
    static gc_device_config_t config;
    static gc_device_t device;
    const uart_config_t uart_config = {.baud_rate = BAUD, .data_bits = UART_DATA_8_BITS, .parity = UART_PARITY_DISABLE,
                                       .stop_bits = UART_STOP_BITS_1, .flow_ctrl = UART_HW_FLOWCTRL_DISABLE};
    const gc_part_t *found;
    ESP_ERROR_CHECK(uart_driver_install(UART_NUM_0, 256, TX_BYTES, 0, NULL, 0));
    ESP_ERROR_CHECK(uart_param_config(UART_NUM_0, &uart_config));
    ESP_ERROR_CHECK(nvs_flash_init());
    ESP_ERROR_CHECK(nvs_open("gyrocal", NVS_READWRITE, &nvs));
    begin_bus();
    vTaskDelay(pdMS_TO_TICKS(100)); /* start-up time of the slowest sensor */
    config.port = &port;
    config.parts = gc_parts;
    config.address = gc_part_look(gc_parts, &port, &found);
    config.calibration = gyrocal_calibration;
    config.net = gyrocal_net;
    gc_device_init(&device, &config);
    for (;;) {
        char data[64];
        const int n = uart_read_bytes(UART_NUM_0, data, sizeof data, 0);
        if (n > 0) {
            gc_device_receive(&device, data, (size_t)n);
        }
        gc_device_step(&device);
    }
}
