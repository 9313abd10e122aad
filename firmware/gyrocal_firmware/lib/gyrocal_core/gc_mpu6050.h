/* Driver of InvenSense's MPU-6050 gyroscope and accelerometer and of its relatives, single samples. The FIFO is not used: it tells
 * neither its level by the interrupt pin nor which sample a byte belongs to once it was full. Sources of the register facts:
 *
 *     addresses, bits            jrowberg/i2cdevlib, Arduino/MPU6050/MPU6050.h, 0b625e2d
 *     ids, temperature, times    torvalds/linux, drivers/iio/imu/inv_mpu6050/inv_mpu_iio.h, 0b70c084
 *     order of the start-up      the same, inv_mpu_core.c, 010e85f9: the clock is the gyroscope's only once that runs
 *     defaults after reset       Register Map RM-MPU-6000A-00 4.2, section 3
 *     read sets of registers     the same, section 4.18: a burst reads one sample
 *     rates, filters             the same, sections 4.2 and 4.3
 *     self-test                  the same, section 4.1, and product specification PS-MPU-6000A-00, section 6.1 (14 %). Steps of the
 *                                procedure, limits without a code, and all of it for the MPU-6500 and its successors:
 *                                sparkfun/SparkFun_MPU-9250-DMP_Arduino_Library, src/util/inv_mpu.c, f46b97c4: get_st_biases,
 *                                gyro_self_test; get_st_6500_biases, gyro_6500_self_test
 *     SPI, of all but the        I2C_IF_DIS, torvalds/linux, drivers/iio/imu/inv_mpu6050/inv_mpu_spi.c, 0ccfdcf9; mode 3, and 1 MHz for
 *     MPU-6050                   all registers, product specification PS-MPU-6500A-01, section 7.5
 */
#ifndef GC_MPU6050_H
#define GC_MPU6050_H

#include "gc_sensor.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GC_MPU6050_ADDRESS 0x68      /* AD0 low */
#define GC_MPU6050_ADDRESS_HIGH 0x69 /* AD0 high */

#define GC_MPU6500_SELF_TEST_X_GYRO 0x00
#define GC_MPU6050_TRIM 0x0D /* SELF_TEST_X, of the MPU-6050 */
#define GC_MPU6050_SMPLRT_DIV 0x19
#define GC_MPU6050_CONFIG 0x1A
#define GC_MPU6050_GYRO_CONFIG 0x1B
#define GC_MPU6050_INT_PIN_CFG 0x37
#define GC_MPU6050_INT_ENABLE 0x38
#define GC_MPU6050_INT_STATUS 0x3A
#define GC_MPU6050_ACCEL_XOUT_H 0x3B
#define GC_MPU6500_USER_CTRL 0x6A
#define GC_MPU6050_PWR_MGMT_1 0x6B
#define GC_MPU6050_WHO_AM_I 0x75

#define GC_MPU6050_ID 0x68 /* of the MPU-6000 and MPU-9150 too */
#define GC_MPU6500_ID 0x70
#define GC_MPU9250_ID 0x71
#define GC_MPU9255_ID 0x73

#define GC_MPU_HAS_ACCEL_FILTER 1u /* traits: a register of its own */

#define GC_MPU6050_RESET 0x80u
#define GC_MPU6050_CLOCK_GYRO 0x01u
#define GC_MPU6050_LATCH_INT 0x20u /* until INT_STATUS is read */
#define GC_MPU6050_DATA_READY 0x01u
#define GC_MPU6500_I2C_IF_DIS 0x10u
#define GC_MPU6050_GYRO_TEST 0xE0u /* all axes, at 250 dps */

#define GC_MPU6050_BOOT_US 100000u
#define GC_MPU6050_RESET_TIMEOUT_US 100000u
#define GC_MPU6050_WAKE_US 5000u     /* until registers are written after sleep */
#define GC_MPU6050_GYRO_ON_US 100000u /* until the gyroscope's clock can be used, and its readings */
#define GC_MPU6050_TEST_US 200000u /* until the self-test has moved the masses */
#define GC_MPU6050_FILTER_US 100000u /* until the slowest filter has settled */

extern const gc_part_t gc_mpu6050, gc_mpu6500, gc_mpu9250, gc_mpu9255;

#ifdef __cplusplus
}
#endif

#endif
