/* The FIFO of ST's newer parts. It stores words, each a tag and three values; the tag says whose values they are and in which time slot
   they were taken. Datasheet DS12140, section 9.65 and application note AN5192, section 9. */
#ifndef GC_TAGGED_FIFO_H
#define GC_TAGGED_FIFO_H

#include "gc_sensor.h"

#ifdef __cplusplus
extern "C" {
#endif

/* In what the parts differ. */
typedef struct {
    uint8_t status_reg; /* FIFO_STATUS1; the level's higher bits are the lowest of the register behind it: */
    uint8_t level_bits; /* so many */
    bool has_parity;    /* bit 0 of a tag makes its parity even */
    double slow_temp_hz, temp_hz; /* the two rates at which the temperature is stored, the slower one with slower samples */
    uint8_t acc_code; /* the accelerometer's rate beyond GC_FIFO_ALONE_HZ */
    double acc_hz;
} gc_tagged_fifo_t;

/* Empties and starts it. */
int gc_tagged_fifo_restart(const gc_tagged_fifo_t *fifo, gc_sensor_t *imu);
int gc_tagged_fifo_read(const gc_tagged_fifo_t *fifo, gc_sensor_t *imu, gc_batch_t *batch);

#ifdef __cplusplus
}
#endif

#endif
