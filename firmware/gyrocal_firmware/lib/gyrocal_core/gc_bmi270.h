/* Driver of Bosch's BMI270 gyroscope and accelerometer. The part measures only after a configuration file of Bosch's was written to it,
 * at each start; the port hands it over (gc_port.h, part_file). Sources of the register facts, unless said otherwise of
 * boschsensortec/BMI270_SensorAPI, 41129fcf:
 *
 *     upload of the file, reset, FIFO frames    bmi2.c: write_config_file, upload_file, bmi2_soft_reset, unpack_gyro_frame
 *     addresses, bits, codes                    bmi2_defs.h, and zephyrproject-rtos/zephyr, drivers/sensor/bosch/bmi270/bmi270.h, 056fd5aa
 *     SPI: dummy byte, readings in vain         bmi2.c: bmi2_soft_reset; zephyr, drivers/sensor/bosch/bmi270/bmi270_spi.c, 2fe8f4d5; mode 0
 *     after power-on and reset                  there; 10 MHz, datasheet BST-BMI270-DS000, section 6.2
 *     self-test                                 bmi2.c: do_gtrigger_test, gyro_crt_test, gyro_self_test_completed; pages, bmi270.h
 *     waits                                     the latter: 450 us between writes in suspend, 45 ms until the gyroscope runs
 *     sensitivities, temperature, noise         datasheet BST-BMI270-DS000, section 1; depth of the FIFO, section 4.8
 *
 * Unlike Bosch's, the driver does not subtract the part's cross-sensitivity of x to z (bmi2_get_gyro_cross_sense) from the readings:
 * what remains is misalignment, which a calibration finds. */
#ifndef GC_BMI270_H
#define GC_BMI270_H

#include "gc_sensor.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GC_BMI270_ADDRESS 0x68      /* SDO low */
#define GC_BMI270_ADDRESS_HIGH 0x69 /* SDO high */

#define GC_BMI270_CHIP_ID 0x00
#define GC_BMI270_STATUS 0x03
#define GC_BMI270_ACC_X 0x0C
#define GC_BMI270_INT_STATUS_1 0x1D
#define GC_BMI270_INTERNAL_STATUS 0x21
#define GC_BMI270_FIFO_DATA 0x26
#define GC_BMI270_FEAT_PAGE 0x2F
#define GC_BMI270_G_TRIG_1 0x32        /* of page 1; with the length of a burst before it */
#define GC_BMI270_GYR_GAIN_STATUS 0x38 /* of page 0 */
#define GC_BMI270_ACC_CONF 0x40
#define GC_BMI270_FIFO_WTM_0 0x46
#define GC_BMI270_FIFO_CONFIG_0 0x48
#define GC_BMI270_INT1_IO_CTRL 0x53
#define GC_BMI270_INT_LATCH 0x55
#define GC_BMI270_INT_MAP_DATA 0x58
#define GC_BMI270_INIT_CTRL 0x59
#define GC_BMI270_INIT_ADDR_0 0x5B
#define GC_BMI270_INIT_DATA 0x5E
#define GC_BMI270_GYR_CRT_CONF 0x69
#define GC_BMI270_GYR_SELF_TEST_AXES 0x6E
#define GC_BMI270_PWR_CONF 0x7C
#define GC_BMI270_PWR_CTRL 0x7D
#define GC_BMI270_CMD 0x7E

#define GC_BMI270_ID 0x24
#define GC_BMI270_SOFT_RESET 0xB6u
#define GC_BMI270_FIFO_FLUSH 0xB0u
#define GC_BMI270_G_TRIGGER 0x02u
#define GC_BMI270_DRDY_GYR 0x40u      /* of STATUS; reading the data clears it */
#define GC_BMI270_FIFO_FULL 0x01u     /* of INT_STATUS_1; reading clears it */
#define GC_BMI270_INIT_MASK 0x0Fu
#define GC_BMI270_INIT_OK 0x01u
#define GC_BMI270_ALL_ON 0x0Eu        /* gyroscope, accelerometer, temperature */
#define GC_BMI270_ALL_BUT_GYR 0x0Cu
#define GC_BMI270_CRT_RUNNING 0x04u
#define GC_BMI270_G_TRIG_STATUS 0x38u  /* why it was given up */
#define GC_BMI270_AXES_OK 0x0Fu        /* it is done, and each axis is right */
#define GC_BMI270_ACC_MODE 0xA0u      /* performance, normal filter */
#define GC_BMI270_GYR_MODE 0xE0u      /* the same, with the lower noise */
#define GC_BMI270_GYR_OSR2 0xD0u
#define GC_BMI270_GYR_OSR4 0xC0u
#define GC_BMI270_INT_ACTIVE_HIGH 0x0Au
#define GC_BMI270_MAP_DRDY 0x04u
#define GC_BMI270_MAP_WATERMARK 0x02u
#define GC_BMI270_FIFO_ACC_GYR 0xC0u  /* without headers */

#define GC_BMI270_BOOT_US 2000u
#define GC_BMI270_RESET_US 2000u
#define GC_BMI270_RESET_TIMEOUT_US 20000u
#define GC_BMI270_WAKE_US 450u        /* between two writes in suspend */
#define GC_BMI270_INIT_TIMEOUT_US 150000u
#define GC_BMI270_TURN_ON_US 80000u
#define GC_BMI270_GYR_OFF_US 1000u
#define GC_BMI270_TEST_TIMEOUT_US 2000000u

extern const gc_part_t gc_bmi270;

#ifdef __cplusplus
}
#endif

#endif
