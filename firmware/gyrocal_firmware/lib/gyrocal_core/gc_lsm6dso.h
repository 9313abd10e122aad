/* Driver of ST's LSM6DSO gyroscope and accelerometer. Registers and figures: datasheet DS12140, application note AN5192. */
#ifndef GC_LSM6DSO_H
#define GC_LSM6DSO_H

#include "gc_port.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GC_LSM6DSO_ADDRESS 0x6B     /* SDO/SA0 high, as on SparkFun's boards */
#define GC_LSM6DSO_ADDRESS_LOW 0x6A /* SDO/SA0 low */

#define GC_LSM6DSO_FIFO_CTRL1 0x07
#define GC_LSM6DSO_INT1_CTRL 0x0D
#define GC_LSM6DSO_CTRL1_XL 0x10
#define GC_LSM6DSO_CTRL2_G 0x11
#define GC_LSM6DSO_CTRL3_C 0x12
#define GC_LSM6DSO_WHO_AM_I 0x0F
#define GC_LSM6DSO_CTRL9_XL 0x18
#define GC_LSM6DSO_STATUS 0x1E
#define GC_LSM6DSO_OUT_TEMP_L 0x20
#define GC_LSM6DSO_FIFO_STATUS1 0x3A
#define GC_LSM6DSO_FREQ_FINE 0x63
#define GC_LSM6DSO_FIFO_DATA_OUT_TAG 0x78

#define GC_LSM6DSO_ID 0x6C /* of the LSM6DSOX and LSM6DSO32 too */
#define GC_LSM6DSO_INT1_DRDY_G 0x02u /* the pin says when the gyroscope has new data */
#define GC_LSM6DSO_INT1_FIFO_TH 0x08u /* the pin says when the FIFO holds as much as its watermark */
#define GC_LSM6DSO_CTRL3_BDU 0x40u
#define GC_LSM6DSO_CTRL3_IF_INC 0x04u
#define GC_LSM6DSO_CTRL3_SW_RESET 0x01u
#define GC_LSM6DSO_CTRL9_I3C_DISABLE 0x02u
#define GC_LSM6DSO_STATUS_XLDA 0x01u
#define GC_LSM6DSO_STATUS_GDA 0x02u
#define GC_LSM6DSO_STATUS_TDA 0x04u

#define GC_LSM6DSO_FIFO_CONTINUOUS 0x06u /* FIFO_CTRL4: the newest overwrite the oldest */
#define GC_LSM6DSO_FIFO_OVERRUN 0x48u /* FIFO_STATUS2: it is full, or was since this register was last read */
#define GC_LSM6DSO_TAG_GYRO 0x01u
#define GC_LSM6DSO_TAG_ACC 0x02u
#define GC_LSM6DSO_TAG_TEMP 0x03u

#define GC_LSM6DSO_FIFO_WORDS 512u
#define GC_LSM6DSO_FIFO_WORD_BYTES 7u /* a tag and three values */
#define GC_LSM6DSO_FIFO_BATCH_MAX 128u /* samples of at most three words: a quarter of the FIFO is left for delays */

#define GC_LSM6DSO_BOOT_US 10000u
#define GC_LSM6DSO_RESET_TIMEOUT_US 10000u /* the datasheet says 50 us */
#define GC_LSM6DSO_TURN_ON_US 80000u /* from power-down until the gyroscope's readings can be used */
#define GC_LSM6DSO_CONFIG_CHECK_US 500000u

/* AN5192: every output data rate is this one halved, whatever round figure the datasheet calls it by. */
#define GC_LSM6DSO_ROOT_HZ 6667.0
#define GC_LSM6DSO_ROOT_CODE 10u
#define GC_LSM6DSO_FREQ_FINE_LSB 0.0015 /* by so much the part's own clock is faster than nominal, as its maker measured */
#define GC_LSM6DSO_LSB_G 0.000061 /* at 2 g */
#define GC_LSM6DSO_LSB_C (1.0 / 256.0)
#define GC_LSM6DSO_ZERO_C 25.0

/* A reading in raw counts. */
typedef struct {
    int16_t temp;
    int16_t gyro[3];
    int16_t acc[3];
    bool fresh; /* the gyroscope's data-ready flag was set */
} gc_sample_t;

/* Samples taken out of the FIFO, oldest first. */
typedef struct {
    gc_sample_t sample[GC_LSM6DSO_FIFO_BATCH_MAX];
    unsigned n;
    unsigned left; /* samples still in there, within one */
    bool overrun;  /* it was full */
    bool gap;      /* samples are missing before the first that comes from now on: it was full, or began anew */
    uint64_t t_us, until_us; /* the level was read then: a period before it at most, the newest sample was taken */
} gc_lsm6dso_batch_t;

typedef struct {
    const gc_port_t *port;
    uint8_t address;
    double odr_hz; /* nominal */
    double period_us; /* by the part's own clock */
    double full_scale_dps;
    double lsb_dps;
    uint8_t ctrl[3]; /* CTRL1_XL, CTRL2_G, CTRL3_C as written */
    uint64_t config_checked_us;
    uint64_t fresh_us; /* when data were last ready */
    unsigned batch;    /* samples between two readings of the FIFO; 0 = it is not used */
    bool fifo_broken;  /* it must begin anew */
    gc_sample_t partial; /* the FIFO's time slot in progress; its temperature is the latest */
    uint8_t partial_slot, partial_has; /* number modulo 4, tags seen */
} gc_lsm6dso_t;

/* The output data rate that serves `rate_hz`: the rate itself if it is one, else the first from 416 Hz on that is a fifth
   above it; 0 = none. */
double gc_lsm6dso_odr_for(double rate_hz);
bool gc_lsm6dso_full_scale_ok(double full_scale_dps);

/* Resets and configures the part and waits until its readings can be used (about 0.1 s).
   odr_hz and full_scale_dps as the two functions above allow, else GC_E_ARGUMENT. */
int gc_lsm6dso_init(gc_lsm6dso_t *imu, const gc_port_t *port, uint8_t address, double odr_hz, double full_scale_dps);

/* 1: new gyroscope data wait; 0: none. */
int gc_lsm6dso_ready(gc_lsm6dso_t *imu);

/* Reads the flag and, where it is set, the sample. Every 0.5 s, and when data stay away, also checks that the part still has its settings.
   Errors: those of the bus, GC_E_CONFIG_LOST (call init again), GC_E_STALE (no data for three output periods). */
int gc_lsm6dso_read(gc_lsm6dso_t *imu, gc_sample_t *sample);

/* After init: lets the FIFO collect gyroscope, accelerometer and temperature, and INT1 tell when there are `batch` samples
   (1 to GC_LSM6DSO_FIFO_BATCH_MAX). init ends it. */
int gc_lsm6dso_fifo_begin(gc_lsm6dso_t *imu, unsigned batch);

/* Takes what the FIFO holds, as much as the batch has room for; what came before an error is there. Errors: as above, and
   GC_E_FIFO_TAG (words came damaged). After one, what the FIFO still held is lost. */
int gc_lsm6dso_fifo_read(gc_lsm6dso_t *imu, gc_lsm6dso_batch_t *batch);

#ifdef __cplusplus
}
#endif

#endif
