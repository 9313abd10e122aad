/* Driver of TDK InvenSense's ICM-42688-P gyroscope and accelerometer, single samples. Sources of the register facts, all in
 * zephyrproject-rtos/zephyr, drivers/sensor/tdk/icm42688:
 *
 *     addresses, bits, codes of rates and ranges     icm42688_reg.h, 20f7c36f
 *     order and times of the start-up                icm42688_common.c, 1de8336b: RESET_DONE 1 ms after a reset, no register written
 *                                                    within 200 us after PWR_MGMT0, INT_CONFIG1 0, 30 ms until the gyroscope runs
 *     order of the readings                          the same, icm42688_read_all
 *     SPI: mode 3, UI_SIFS_CFG                       ../icm4268x/icm4268x.c and icm4268x_common.c, 556c620b; mode 3 and 24 MHz of its
 *                                                    kin: torvalds/linux, Documentation/devicetree/bindings/iio/imu,
 *                                                    invensense,icm42600.yaml, 20c7775a
 *
 * Sensitivities, temperature and noise are those of datasheet DS-000347. Self-test: InvenSense's own driver in
 * VaderMester/ESP32-ICM426XX-driver, components/ICM426XX/Invn/Drivers/Icm426xx, a60ffe2e: Icm426xxSelfTest.c, run_gyro_self_test and
 * average_sensor_output; its registers, Icm426xxDefs.h. */
#ifndef GC_ICM42688_H
#define GC_ICM42688_H

#include "gc_sensor.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GC_ICM42688_ADDRESS 0x68      /* AP_AD0 low */
#define GC_ICM42688_ADDRESS_HIGH 0x69 /* AP_AD0 high */

#define GC_ICM42688_DEVICE_CONFIG 0x11
#define GC_ICM42688_INT_CONFIG 0x14
#define GC_ICM42688_TEMP_DATA1 0x1D
#define GC_ICM42688_INT_STATUS 0x2D
#define GC_ICM42688_INTF_CONFIG0 0x4C
#define GC_ICM42688_PWR_MGMT0 0x4E
#define GC_ICM42688_GYRO_CONFIG1 0x51
#define GC_ICM42688_GYRO_ACCEL_CONFIG0 0x52
#define GC_ICM42688_INT_CONFIG1 0x64
#define GC_ICM42688_INT_SOURCE0 0x65
#define GC_ICM42688_SELF_TEST_CONFIG 0x70
#define GC_ICM42688_WHO_AM_I 0x75
#define GC_ICM42688_REG_BANK_SEL 0x76 /* of every bank */
#define GC_ICM42688_XG_ST_DATA 0x5F   /* of bank 1 */

#define GC_ICM42688_ID 0x47
#define GC_ICM42688_SOFT_RESET 0x01u
#define GC_ICM42688_INT1_LATCHED 0x07u /* until INT_STATUS is read; push-pull, active high */
#define GC_ICM42688_DATA_READY 0x08u   /* of INT_STATUS, and its source */
#define GC_ICM42688_RESET_DONE 0x10u
#define GC_ICM42688_I2C_OFF 0x03u      /* UI_SIFS_CFG */
#define GC_ICM42688_LOW_NOISE 0x0Fu    /* both sensors */
#define GC_ICM42688_ACCEL_FILTER_DEFAULT 0x10u /* a quarter of the rate */
#define GC_ICM42688_GYRO_FILTER_DEFAULT 0x01u  /* the same */
#define GC_ICM42688_GYRO_ORDER 0x0Cu
#define GC_ICM42688_GYRO_3RD_ORDER 0x08u
#define GC_ICM42688_GYRO_FILTER 0x0Fu
#define GC_ICM42688_GYRO_TENTH 0x04u /* its bandwidth is a tenth of the rate */
#define GC_ICM42688_TEST_250_DPS_1_KHZ 0x66u
#define GC_ICM42688_GYRO_TEST 0x07u  /* all axes */

#define GC_ICM42688_BOOT_US 3000u
#define GC_ICM42688_RESET_US 1000u
#define GC_ICM42688_RESET_TIMEOUT_US 10000u
#define GC_ICM42688_TURN_ON_US 80000u
#define GC_ICM42688_TEST_US 200000u /* until the self-test has moved the masses */

extern const gc_part_t gc_icm42688;

#ifdef __cplusplus
}
#endif

#endif
