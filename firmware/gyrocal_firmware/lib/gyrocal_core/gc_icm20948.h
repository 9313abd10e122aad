/* Driver of TDK InvenSense's ICM-20948 gyroscope and accelerometer, single samples; its magnetometer is left alone. Sources of the
 * register facts:
 *
 *     banks, addresses, bits, id          sparkfun/SparkFun_ICM-20948_ArduinoLibrary, src/util/ICM_20948_REGISTERS.h and _C.h, 32cf0614
 *     order of the start-up, waits        the same, src/ICM_20948.cpp, startupDefault: 50 ms after a reset, awake, then the rest
 *     filters                             the same, src/util/ICM_20948_ENUMERATIONS.h: bandwidths by code
 *     sensitivities, temperature          zephyrproject-rtos/zephyr, drivers/sensor/tdk/icm20948/icm20948.c, 4023c096
 *     SPI: mode 3                         the first, src/ICM_20948.h; 7 MHz, datasheet DS-000189, section 3.4; I2C_IF_DIS, section 8.2
 *     self-test                           skywalk-software/Teensy-ICM-20948, src/Icm20948SelfTest.c, 75f36fe3 (InvenSense's own driver)
 *     rates (1125 Hz over a divider and   datasheet DS-000189, sections 10.1 and 3.1. SparkFun's comment says 1.1 kHz
 *     one), noise
 *
 * Unlike them, the driver lets the data-ready interrupt latch, and reads the registers of bank 2 again to see a lost supply. */
#ifndef GC_ICM20948_H
#define GC_ICM20948_H

#include "gc_sensor.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GC_ICM20948_ADDRESS 0x68      /* AD0 low */
#define GC_ICM20948_ADDRESS_HIGH 0x69 /* AD0 high, as on SparkFun's boards */

#define GC_ICM20948_BANK_SEL 0x7F /* of every bank */
#define GC_ICM20948_BANK_1 0x10u
#define GC_ICM20948_BANK_2 0x20u

#define GC_ICM20948_WHO_AM_I 0x00 /* of bank 0, as those that follow */
#define GC_ICM20948_USER_CTRL 0x03
#define GC_ICM20948_LP_CONFIG 0x05
#define GC_ICM20948_PWR_MGMT_1 0x06
#define GC_ICM20948_INT_PIN_CFG 0x0F
#define GC_ICM20948_INT_ENABLE_1 0x11
#define GC_ICM20948_INT_STATUS_1 0x1A
#define GC_ICM20948_ACCEL_XOUT_H 0x2D

#define GC_ICM20948_SELF_TEST_X_GYRO 0x02 /* of bank 1 */

#define GC_ICM20948_GYRO_SMPLRT_DIV 0x00 /* of bank 2, as those that follow */
#define GC_ICM20948_GYRO_CONFIG_1 0x01
#define GC_ICM20948_GYRO_CONFIG_2 0x02
#define GC_ICM20948_ACCEL_SMPLRT_DIV_2 0x11
#define GC_ICM20948_ACCEL_CONFIG 0x14

#define GC_ICM20948_ID 0xEA
#define GC_ICM20948_I2C_IF_DIS 0x10u
#define GC_ICM20948_RESET 0x80u
#define GC_ICM20948_CLOCK_AUTO 0x01u
#define GC_ICM20948_LATCH_INT 0x20u /* until INT_STATUS_1 is read */
#define GC_ICM20948_DATA_READY 0x01u
#define GC_ICM20948_FILTER_ON 0x01u
#define GC_ICM20948_GYRO_CYCLE 0x10u
#define GC_ICM20948_MEAN_OF_8 0x03u    /* each reading is one, in cycles */
#define GC_ICM20948_GYRO_TEST 0x38u    /* all axes */
#define GC_ICM20948_TEST_DIVIDER 10u

#define GC_ICM20948_BOOT_US 100000u
#define GC_ICM20948_RESET_TIMEOUT_US 100000u
#define GC_ICM20948_AFTER_RESET_US 50000u
#define GC_ICM20948_TURN_ON_US 100000u /* until the gyroscope and the slowest filter have settled */
#define GC_ICM20948_TEST_US 50000u /* until the self-test has moved the masses */

extern const gc_part_t gc_icm20948;

#ifdef __cplusplus
}
#endif

#endif
