#ifndef GYROCAL_STM32_H
#define GYROCAL_STM32_H

#ifndef GYROCAL_HAL
#define GYROCAL_HAL "stm32f4xx_hal.h"
#endif
#include GYROCAL_HAL

void gyrocal_begin(I2C_HandleTypeDef *i2c, UART_HandleTypeDef *wire);
void gyrocal_step(void);
/* A byte that the wire received; from the interrupt. */
void gyrocal_hear(uint8_t byte);

#endif
