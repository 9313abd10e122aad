/* Driver of Bosch's BMI088: a gyroscope and an accelerometer, two dies in one package, each with an address of its own. Sources of the
 * register facts, all of boschsensortec/BMI08x_SensorAPI, c1ed227e, unless said otherwise:
 *
 *     addresses, bits, codes, sensitivities     bmi08_defs.h
 *     order of the start-up, waits              bmi08a.c: bmi08a_set_power_mode, bmi08a_soft_reset; bmi08g.c: bmi08g_soft_reset
 *     temperature                               bmi08a.c: bmi08a_get_sensor_temperature
 *     FIFO                                      bmi08g.c: bmi08g_set_fifo_config; its depth and what clears it, datasheet
 *                                               BST-BMI088-DS001, section 4.6
 *     SPI: the accelerometer's dummy byte and   bmi08a.c: bmi08a_init, bmi08a_soft_reset; 10 MHz: torvalds/linux,
 *     readings in vain                          Documentation/devicetree/bindings/iio/accel/bosch,bmi088.yaml, 320424c7; mode 0
 *     self-test                                 bmi08g.c: bmi08g_perform_selftest
 *     noise                                     datasheet, section 1
 *
 * The gyroscope's data-ready state shows for some 300 us only, and reading clears nothing. Therefore the driver has the FIFO run
 * always: samples that it holds are new. The accelerometer has no part in it, and is read with each sample, or once a batch. */
#ifndef GC_BMI088_H
#define GC_BMI088_H

#include "gc_sensor.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GC_BMI088_ADDRESS 0x68      /* gyroscope, SDO2 low */
#define GC_BMI088_ADDRESS_HIGH 0x69 /* SDO2 high */
#define GC_BMI088_ACC_ADDRESS 0x18  /* accelerometer, SDO1 low; 0x19 = high */

#define GC_BMI088_CHIP_ID 0x00 /* of the gyroscope, as those that follow */
#define GC_BMI088_RATE_X 0x02
#define GC_BMI088_FIFO_STATUS 0x0E
#define GC_BMI088_RANGE 0x0F
#define GC_BMI088_BANDWIDTH 0x10
#define GC_BMI088_SOFTRESET 0x14
#define GC_BMI088_INT_CTRL 0x15
#define GC_BMI088_INT3_IO_CONF 0x16
#define GC_BMI088_INT3_IO_MAP 0x18
#define GC_BMI088_FIFO_WM_EN 0x1E
#define GC_BMI088_SELF_TEST 0x3C
#define GC_BMI088_FIFO_CONFIG_0 0x3D
#define GC_BMI088_FIFO_CONFIG_1 0x3E
#define GC_BMI088_FIFO_DATA 0x3F

#define GC_BMI088_ACC_CHIP_ID 0x00 /* of the accelerometer, as those that follow */
#define GC_BMI088_ACC_X 0x12
#define GC_BMI088_ACC_TEMP 0x22
#define GC_BMI088_ACC_CONF 0x40
#define GC_BMI088_ACC_PWR_CONF 0x7C
#define GC_BMI088_ACC_PWR_CTRL 0x7D
#define GC_BMI088_ACC_SOFTRESET 0x7E

#define GC_BMI088_ID 0x0F     /* that of other gyroscopes too */
#define GC_BMI088_ACC_ID 0x1E
#define GC_BMI088_RESET 0xB6u
#define GC_BMI088_BANDWIDTH_READS 0x80u /* set in what BANDWIDTH reads */
#define GC_BMI088_FIFO_STREAM 0x80u
#define GC_BMI088_FIFO_OVERRUN 0x80u
#define GC_BMI088_FIFO_LEVEL 0x7Fu
#define GC_BMI088_INT_DATA 0x80u
#define GC_BMI088_INT_FIFO 0x40u
#define GC_BMI088_WM_ON 0x80u
#define GC_BMI088_INT3_ACTIVE_HIGH 0x01u
#define GC_BMI088_MAP_DATA 0x01u
#define GC_BMI088_MAP_FIFO 0x04u
#define GC_BMI088_TEST_BEGIN 0x01u
#define GC_BMI088_TEST_READY 0x02u
#define GC_BMI088_TEST_FAILED 0x04u
#define GC_BMI088_ACC_MODE 0xA0u /* normal filter */
#define GC_BMI088_ACC_ON 0x04u

#define GC_BMI088_BOOT_US 30000u
#define GC_BMI088_RESET_TIMEOUT_US 60000u /* 30 ms by the datasheet */
#define GC_BMI088_ACC_POWER_US 5000u
#define GC_BMI088_TURN_ON_US 80000u
#define GC_BMI088_TEST_TIMEOUT_US 500000u
#define GC_BMI088_TEMP_EVERY_US 500000u /* the part renews it every 1.28 s */

extern const gc_part_t gc_bmi088;

#ifdef __cplusplus
}
#endif

#endif
