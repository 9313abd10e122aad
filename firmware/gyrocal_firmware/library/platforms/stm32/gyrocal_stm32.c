/* The port to STM32's HAL: call gyrocal_begin (or gyrocal_begin_spi) once after MX_I2C1_Init and MX_USART2_UART_Init, gyrocal_step for ever, and
   gyrocal_hear from HAL_UART_RxCpltCallback. GYROCAL_HAL is the HAL's header of your chip. It keeps nothing over power-off. */
#include "gyrocal_stm32.h"

#include "gc_device.h"
#include "gc_parts.h"
#include "headers.h"

#include <string.h>

#define TRANSFER_MS 10u
#define SEND_BYTES 512u /* two sentences, of which one is on the wire */

static I2C_HandleTypeDef *bus;
static UART_HandleTypeDef *uart;
static gc_device_config_t config;
static gc_device_t device;
static uint32_t last_cycles;
static uint64_t cycles;
static uint8_t out[SEND_BYTES];

static int bus_write(void *context, uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
    uint8_t copy[64]; /* the HAL wants bytes that it may write to */
    (void)context;
    if (n > sizeof copy) {
        return -1;
    }
    memcpy(copy, data, n);
    return HAL_I2C_Mem_Write(bus, (uint16_t)(address << 1), reg, I2C_MEMADD_SIZE_8BIT, copy, (uint16_t)n, TRANSFER_MS) == HAL_OK
               ? (int)n
               : -1;
}

static int bus_read(void *context, uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
    (void)context;
    return HAL_I2C_Mem_Read(bus, (uint16_t)(address << 1), reg, I2C_MEMADD_SIZE_8BIT, data, (uint16_t)n, TRANSFER_MS) == HAL_OK
               ? (int)n
               : -1;
}

/* The cycle counter begins anew every 25 s at 168 MHz; it is asked far more often. */
static uint64_t now_us(void *context) {
    (void)context;
    const uint32_t now = DWT->CYCCNT;
    cycles += (uint32_t)(now - last_cycles);
    last_cycles = now;
    return cycles / (SystemCoreClock / 1000000u);
}

static void wait_until_us(void *context, uint64_t t_us) {
    while (now_us(context) < t_us) {
    }
}

/* By interrupt or DMA, so that sampling does not wait; while a sentence is on the wire, the next one is dropped and counted. */
static int send(void *context, const char *data, size_t n) {
    (void)context;
    if (n > sizeof out || uart->gState != HAL_UART_STATE_READY) {
        return -1;
    }
    memcpy(out, data, n);
    return HAL_UART_Transmit_IT(uart, out, (uint16_t)n) == HAL_OK ? (int)n : -1;
}

static void restart(void *context) {
    (void)context;
    HAL_Delay(100);
    NVIC_SystemReset();
}

static const uint8_t *part_file(void *context, const char *part, size_t *n) {
    (void)context;
    (void)part;
    *n = gyrocal_part_file_bytes;
    return gyrocal_part_file;
}

static void begin(const gc_port_t *port, UART_HandleTypeDef *wire) {
    const gc_part_t *found;
    uart = wire;
    CoreDebug->DEMCR |= CoreDebug_DEMCR_TRCENA_Msk;
    DWT->CTRL |= DWT_CTRL_CYCCNTENA_Msk;
    HAL_Delay(100); /* start-up time of the slowest sensor */
    config.port = port;
    config.parts = gc_parts;
    config.address = gc_part_look(gc_parts, port, &found);
    config.calibration = gyrocal_calibration;
    config.net = gyrocal_net;
    gc_device_init(&device, &config);
}

#define REST .now_us = now_us, .wait_until_us = wait_until_us, .send = send, .restart = restart, .part_file = part_file

void gyrocal_begin(I2C_HandleTypeDef *i2c, UART_HandleTypeDef *wire) {
    static const gc_port_t port = {.bus_write = bus_write, .bus_read = bus_read, REST};
    bus = i2c;
    begin(&port, wire);
}

#ifdef HAL_SPI_MODULE_ENABLED

#define SPI_HZ 8000000u /* at most; slower where the wires are long */

static SPI_HandleTypeDef *spi;
static struct {
    GPIO_TypeDef *port;
    uint16_t pin;
} selects[2]; /* of both dies */

/* By the faster of the two clocks that an SPI may have, so that the other one is slower and never faster. */
static bool set_up_spi(const gc_spi_t *how) {
    static const uint32_t prescalers[] = {SPI_BAUDRATEPRESCALER_2,  SPI_BAUDRATEPRESCALER_4,  SPI_BAUDRATEPRESCALER_8,
                                          SPI_BAUDRATEPRESCALER_16, SPI_BAUDRATEPRESCALER_32, SPI_BAUDRATEPRESCALER_64,
                                          SPI_BAUDRATEPRESCALER_128, SPI_BAUDRATEPRESCALER_256};
    const uint32_t most_hz = how->most_hz < SPI_HZ ? how->most_hz : SPI_HZ;
    const uint32_t polarity = (how->mode & 2u) != 0u ? SPI_POLARITY_HIGH : SPI_POLARITY_LOW;
    const uint32_t phase = (how->mode & 1u) != 0u ? SPI_PHASE_2EDGE : SPI_PHASE_1EDGE;
    uint32_t hz = HAL_RCC_GetPCLK2Freq() / 2u;
    unsigned k = 0;
    for (; hz > most_hz && k < 7u; hz /= 2u) {
        k++;
    }
    if (spi->Init.BaudRatePrescaler == prescalers[k] && spi->Init.CLKPolarity == polarity && spi->Init.CLKPhase == phase) {
        return true;
    }
    spi->Init.BaudRatePrescaler = prescalers[k];
    spi->Init.CLKPolarity = polarity;
    spi->Init.CLKPhase = phase;
    return HAL_SPI_Init(spi) == HAL_OK;
}

static int transfer(void *context, unsigned die, const gc_spi_t *how, const uint8_t *out, size_t n_out, uint8_t *in, size_t n_in) {
    uint8_t copy[GC_WRITE_MAX + 1u]; /* the HAL wants bytes that it may write to */
    (void)context;
    if (selects[die].port == NULL || n_out > sizeof copy || !set_up_spi(how)) {
        return -1;
    }
    memcpy(copy, out, n_out);
    HAL_GPIO_WritePin(selects[die].port, selects[die].pin, GPIO_PIN_RESET);
    HAL_StatusTypeDef status = HAL_SPI_Transmit(spi, copy, (uint16_t)n_out, TRANSFER_MS);
    if (status == HAL_OK && n_in > 0u) {
        status = HAL_SPI_Receive(spi, in, (uint16_t)n_in, TRANSFER_MS);
    }
    HAL_GPIO_WritePin(selects[die].port, selects[die].pin, GPIO_PIN_SET);
    return status == HAL_OK ? 0 : -1;
}

void gyrocal_begin_spi(SPI_HandleTypeDef *handle, GPIO_TypeDef *cs_port, uint16_t cs_pin, GPIO_TypeDef *other_port, uint16_t other_pin,
                       UART_HandleTypeDef *wire) {
    static const gc_port_t port = {.spi = transfer, REST};
    spi = handle;
    selects[0].port = cs_port;
    selects[0].pin = cs_pin;
    selects[1].port = other_port;
    selects[1].pin = other_pin;
    for (unsigned die = 0; die < 2u; die++) {
        if (selects[die].port != NULL) {
            HAL_GPIO_WritePin(selects[die].port, selects[die].pin, GPIO_PIN_SET);
        }
    }
    begin(&port, wire);
}

#endif

static volatile uint8_t heard[128];
static volatile unsigned heard_n, taken_n;

void gyrocal_hear(uint8_t byte) {
    heard[heard_n % sizeof heard] = byte;
    heard_n++;
}

void gyrocal_step(void) {
    while (taken_n != heard_n) {
        const char byte = (char)heard[taken_n % sizeof heard];
        taken_n++;
        gc_device_receive(&device, &byte, 1);
    }
    gc_device_step(&device);
}
