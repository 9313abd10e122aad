/* Driver of ST's LSM6DSV gyroscope and accelerometer, which shares its id with the LSM6DSV16X. Sources of the register facts:
 *
 *     addresses, bits, codes of rates and ranges,      STMicroelectronics/lsm6dsv-pid, lsm6dsv_reg.h, f045c602
 *     sensitivities, temperature, FIFO, low-pass (LPF1), time stamps
 *     both sensors off before a reset                  the same, lsm6dsv_reg.c, lsm6dsv_sw_reset
 *     INTERNAL_FREQ: 0.13 % a count                    STMicroelectronics/lsm6dsv16x-pid, lsm6dsv16x_reg.c, early ones:
 *                                                      lsm6dsv16x_odr_cal_reg_get; of 7680 Hz, as the highest rate
 *     noise, turn-on, depth of the FIFO, self-test     datasheet DS13476
 *     SPI: mode 3 as its kin, I2C_I3C_disable          lsm6dsv_reg.h, lsm6dsv_ui_i2c_i3c_mode_set; 10 MHz, DS13476
 *
 * Bit 0 of IF_CFG, unlike that of older parts, switches off I2C as well; on I2C it stays 0. */
#ifndef GC_LSM6DSV_H
#define GC_LSM6DSV_H

#include "gc_sensor.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GC_LSM6DSV_ADDRESS 0x6B     /* SDO/SA0 high */
#define GC_LSM6DSV_ADDRESS_LOW 0x6A /* SDO/SA0 low */

#define GC_LSM6DSV_FUNC_CFG_ACCESS 0x01
#define GC_LSM6DSV_IF_CFG 0x03
#define GC_LSM6DSV_INT1_CTRL 0x0D
#define GC_LSM6DSV_WHO_AM_I 0x0F
#define GC_LSM6DSV_CTRL1 0x10
#define GC_LSM6DSV_CTRL2 0x11
#define GC_LSM6DSV_CTRL3 0x12
#define GC_LSM6DSV_CTRL6 0x15
#define GC_LSM6DSV_CTRL10 0x19
#define GC_LSM6DSV_FIFO_STATUS1 0x1B
#define GC_LSM6DSV_STATUS 0x1E
#define GC_LSM6DSV_OUT_TEMP_L 0x20
#define GC_LSM6DSV_INTERNAL_FREQ 0x4F

#define GC_LSM6DSV_FUNCTIONS_ENABLE 0x50

#define GC_LSM6DSV_ID 0x70
#define GC_LSM6DSV_I2C_I3C_DISABLE 0x01u
#define GC_LSM6DSV_INT1_DRDY_G 0x02u
#define GC_LSM6DSV_INT1_FIFO_TH 0x08u
#define GC_LSM6DSV_CTRL3_BDU 0x40u
#define GC_LSM6DSV_CTRL3_IF_INC 0x04u
#define GC_LSM6DSV_CTRL3_SW_RESET 0x01u
#define GC_LSM6DSV_CTRL7_LPF1_G_EN 0x01u
#define GC_LSM6DSV_CTRL10_GYRO_TEST 0x04u /* the gyroscope's mass is moved as by a positive rate */
#define GC_LSM6DSV_TIMESTAMP 0x40u
#define GC_LSM6DSV_STATUS_GDA 0x02u
#define GC_LSM6DSV_FREQ_LSB 0.0013

#define GC_LSM6DSV_BOOT_US 10000u
#define GC_LSM6DSV_RESET_TIMEOUT_US 10000u
#define GC_LSM6DSV_TURN_ON_US 80000u
#define GC_LSM6DSV_TEST_US 100000u

extern const gc_part_t gc_lsm6dsv;

#ifdef __cplusplus
}
#endif

#endif
