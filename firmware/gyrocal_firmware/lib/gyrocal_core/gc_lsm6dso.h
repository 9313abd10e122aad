/* Driver of ST's LSM6DSO gyroscope and accelerometer and of its relatives. Registers and figures of the LSM6DSO: datasheet DS12140,
 * application note AN5192. The others as far as they differ:
 *
 *     LSM6DSOX     as the LSM6DSO, with the same id
 *     LSM6DSO32    the same id, but its least accelerometer range is 4 g: STMicroelectronics/lsm6dso32-pid, lsm6dso32_reg.c, 06a75681
 *     LSM6DSR      id, 4000 dps in bit 0 of CTRL2_G: STMicroelectronics/lsm6dsr-pid, lsm6dsr_reg.h, 2f412a46
 *     LSM6DS3TR-C  (LSM6DSL, LSM6DSM) id, no I3C, no INTERNAL_FREQ_FINE, a FIFO of another kind that this driver does not use:
 *                  STMicroelectronics/lsm6ds3tr-c-pid, lsm6ds3tr-c_reg.h, 39233342
 *     low-pass     LPF1 and FTYPE, STMicroelectronics/lsm6dso-pid, lsm6dso_reg.h, 163f39a5, lsm6dso_ftype_t; the LSM6DS3TR-C has
 *                  two bits of it: lsm6ds3tr-c_reg.h, lsm6ds3tr_c_lpf1_sel_g_t; the LSM6DS3 has no LPF1
 *     time stamps  TIMESTAMP_EN, their tag and how many are stored: the same lsm6dso_reg.h
 *     self-test    AN5192, section 8: 208 Hz and 2000 dps, 150 to 700 dps by the datasheets of all of them
 *     SPI          mode 3, zephyrproject-rtos/zephyr, drivers/sensor/st/lsm6dso/lsm6dso.c, 0cdbf892; I2C_disable, each part's _reg.h;
 *                  10 MHz, DS12140, section 4.4.1
 *     LSM6DS3      id, likewise, and 16 counts a degree: STMicroelectronics/lsm6ds3-pid, lsm6ds3_reg.c, 13df2967
 */
#ifndef GC_LSM6DSO_H
#define GC_LSM6DSO_H

#include "gc_sensor.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GC_LSM6DSO_ADDRESS 0x6B     /* SDO/SA0 high, as on SparkFun's boards */
#define GC_LSM6DSO_ADDRESS_LOW 0x6A /* SDO/SA0 low */

#define GC_LSM6DSO_FUNC_CFG_ACCESS 0x01
#define GC_LSM6DSO_INT1_CTRL 0x0D
#define GC_LSM6DSO_CTRL1_XL 0x10
#define GC_LSM6DSO_CTRL2_G 0x11
#define GC_LSM6DSO_CTRL3_C 0x12
#define GC_LSM6DSO_CTRL4_C 0x13
#define GC_LSM6DSO_CTRL5_C 0x14
#define GC_LSM6DSO_WHO_AM_I 0x0F
#define GC_LSM6DSO_CTRL9_XL 0x18
#define GC_LSM6DSO_CTRL10_C 0x19
#define GC_LSM6DSO_STATUS 0x1E
#define GC_LSM6DSO_OUT_TEMP_L 0x20
#define GC_LSM6DSO_FIFO_STATUS1 0x3A
#define GC_LSM6DSO_FREQ_FINE 0x63

#define GC_LSM6DSO_ID 0x6C
#define GC_LSM6DSR_ID 0x6B
#define GC_LSM6DS3TRC_ID 0x6A
#define GC_LSM6DS3_ID 0x69

#define GC_LSM6_HAS_I3C 1u       /* traits */
#define GC_LSM6_HAS_FREQ_FINE 2u

#define GC_LSM6DSO_INT1_DRDY_G 0x02u /* the pin says when the gyroscope has new data */
#define GC_LSM6DSO_INT1_FIFO_TH 0x08u /* the pin says when the FIFO holds as much as its watermark */
#define GC_LSM6DSO_CTRL3_BDU 0x40u
#define GC_LSM6DSO_CTRL3_IF_INC 0x04u
#define GC_LSM6DSO_CTRL4_LPF1_SEL_G 0x02u
#define GC_LSM6DSO_CTRL4_I2C_DISABLE 0x04u
#define GC_LSM6DSO_CTRL3_SW_RESET 0x01u
#define GC_LSM6DSO_CTRL9_I3C_DISABLE 0x02u
#define GC_LSM6DSO_CTRL5_GYRO_TEST 0x04u /* the gyroscope's mass is moved as by a positive rate */
#define GC_LSM6DSO_CTRL10_TIMESTAMP 0x20u
#define GC_LSM6DSO_STATUS_XLDA 0x01u
#define GC_LSM6DSO_STATUS_GDA 0x02u
#define GC_LSM6DSO_STATUS_TDA 0x04u

#define GC_LSM6DSO_BOOT_US 10000u
#define GC_LSM6DSO_RESET_TIMEOUT_US 10000u /* 50 us by the datasheet */
#define GC_LSM6DSO_TEST_US 100000u /* until the self-test has moved the mass */
#define GC_LSM6DSO_TURN_ON_US 80000u /* from power-down until the gyroscope's readings can be used */

/* AN5192: every output data rate is this rate halved some times; the datasheet gives rounded figures. */
#define GC_LSM6DSO_ROOT_HZ 6667.0
#define GC_LSM6DSO_ROOT_CODE 10u
#define GC_LSM6DSO_FREQ_FINE_LSB 0.0015 /* deviation of the part's own clock from nominal, as measured by the maker */

extern const gc_part_t gc_lsm6dso, gc_lsm6dsox, gc_lsm6dso32, gc_lsm6dsr, gc_lsm6ds3trc, gc_lsm6ds3;

#ifdef __cplusplus
}
#endif

#endif
