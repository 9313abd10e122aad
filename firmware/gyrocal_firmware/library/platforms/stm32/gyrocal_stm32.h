#ifndef GYROCAL_STM32_H
#define GYROCAL_STM32_H

#ifndef GYROCAL_HAL
#define GYROCAL_HAL "stm32f4xx_hal.h"
#endif
#include GYROCAL_HAL

void gyrocal_begin(I2C_HandleTypeDef *i2c, UART_HandleTypeDef *wire);
#ifdef HAL_SPI_MODULE_ENABLED
/* The same for a sensor by SPI, after MX_SPI1_Init (full duplex master, 8 bits): its chip select, and that of a BMI088's accelerometer
   or NULL. Both are outputs without the SPI's own NSS. Clock and mode are set by what the sensor wants. */
void gyrocal_begin_spi(SPI_HandleTypeDef *spi, GPIO_TypeDef *cs_port, uint16_t cs_pin, GPIO_TypeDef *other_port, uint16_t other_pin,
                       UART_HandleTypeDef *wire);
#endif
void gyrocal_step(void);
/* A byte that the wire received; from the interrupt. */
void gyrocal_hear(uint8_t byte);

#endif
