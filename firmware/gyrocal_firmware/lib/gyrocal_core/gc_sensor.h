/* The interface to a sensor. A driver fills a gc_part_t for each part of its family; the core names parts nowhere else but in the
   list gc_parts.h. */
#ifndef GC_SENSOR_H
#define GC_SENSOR_H

#include "gc_port.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GC_BATCH_MAX 128u  /* samples taken out of a FIFO at once */
#define GC_WATCHED_MAX 8u  /* registers */
#define GC_WRITE_MAX 16u   /* bytes written at once: some boards' I2C buffers hold 32 */
/* Faster samples leave the part through the FIFO alone, and the accelerometer's come at a slower rate: a bus of 400 kHz carries no
   more. Nor does the wire carry a stream of them. */
#define GC_FIFO_ALONE_HZ 2000.0
#define GC_SENSOR_CONFIG_CHECK_US 500000u

/* A reading in raw counts. */
typedef struct {
    int16_t temp;
    int16_t gyro[3];
    int16_t acc[3];
    bool fresh; /* the gyroscope's data-ready flag was set */
} gc_sample_t;

/* Samples taken out of the FIFO, oldest first. */
typedef struct {
    gc_sample_t sample[GC_BATCH_MAX];
    unsigned n;
    unsigned left; /* samples still in there, within one */
    bool overrun;  /* it was full */
    bool gap;      /* samples are missing before the next one, because the FIFO was full or was started again */
    unsigned stamps; /* of the part's own time */
    bool lost_known; /* they tell how many did not come since they last told it: */
    uint32_t lost;
    uint64_t t_us, until_us; /* time at which the level was read; the newest sample was taken within one period before it */
} gc_batch_t;

typedef struct {
    double hz;
    uint8_t code; /* value of the part's register for this rate */
} gc_odr_t;

typedef struct {
    double full_scale_dps;
    double lsb_dps;
    uint8_t code;
} gc_range_t;

/* A range of the accelerometer. */
typedef struct {
    double g;
    uint8_t code;
} gc_accel_t;

/* How a part is set up. */
typedef struct {
    double odr_hz, full_scale_dps;
    double accel_g;    /* range of the accelerometer; 0 = the least */
    unsigned low_pass; /* number of the gyroscope's low-pass, from 1; 0 = the driver's choice */
} gc_setup_t;

/* What the part's own test of the gyroscope found. NaN: the part tells the result alone, or the maker sets no such limit. */
typedef struct {
    bool passed;
    double change_dps[3];               /* by which the test moved each axis */
    double least_dps[3], most_dps[3];   /* between which the maker wants it */
    double rest_dps[3], rest_most_dps;  /* the readings before, and the largest that the maker allows */
} gc_self_test_t;

/* The part's own time in its FIFO: a stamp at some samples, in ticks. The samples between two stamps tell the ticks of one. */
typedef struct {
    bool known;            /* a stamp came */
    uint32_t ticks;        /* the latest */
    int32_t since;         /* samples since the stamped one; -1 = that comes next */
    double ticks_a_sample; /* 0 = not known yet */
    uint32_t base_ticks, base_samples; /* it is counted from here */
} gc_stamps_t;

typedef struct gc_sensor gc_sensor_t;

/* A kind of sensor. The functions return GC_OK or an error of gc_error.h. */
typedef struct {
    const char *name;
    uint8_t address[2]; /* on I2C, by a pin of the part; the first is the usual one */
    const gc_spi_t *spi[2]; /* of its dies; NULL = there is none */
    uint8_t id_reg, id; /* its register WHO_AM_I and what that holds; some parts share one */
    uint8_t traits;     /* the driver's own: in what the parts of its family differ */
    double lsb_g, lsb_c; /* of the accelerometer's least range */
    double noise_dps; /* typical standard deviation of one reading */
    double zero_c; /* temperature = zero_c + lsb_c * counts */
    const gc_odr_t *odr; /* output data rates, ascending */
    size_t odrs;
    double polled_from_hz; /* for any other rate the sensor is polled, at this output data rate or above */
    const gc_range_t *range;
    size_t ranges;
    const gc_accel_t *accel; /* ascending */
    size_t accels;
    unsigned low_passes; /* that the maker's registers number, and, where some rates have fewer of them: */
    unsigned (*low_passes_at)(double odr_hz);
    uint8_t watched_reg; /* the first of the registers that must keep what was written to them, and */
    uint8_t watched;     /* how many there are */
    /* Optional, where they do not lie in a row or on one die: reads them in the order of `written`. */
    int (*read_watched)(gc_sensor_t *sensor, uint8_t *found);
    unsigned batch_max;  /* largest batch of the FIFO in samples; 0 = the part has no FIFO */

    /* Returns GC_E_WRONG_ID if another part answers. Changes nothing else of any part. */
    int (*identify)(gc_sensor_t *sensor);
    /* Identifies, resets and configures the part, and waits until its readings can be used. Sets period_us and written. */
    int (*set_up)(gc_sensor_t *sensor);
    /* Returns 1 if new gyroscope data wait, 0 if none do, negative on error. */
    int (*ready)(gc_sensor_t *sensor);
    int (*read)(gc_sensor_t *sensor, gc_sample_t *sample);
    /* Starts the FIFO, and the interrupt line for every sensor->batch samples. set_up stops both. */
    int (*fifo_begin)(gc_sensor_t *sensor);
    /* Reads the FIFO into a batch and sets all of its fields. */
    int (*fifo_read)(gc_sensor_t *sensor, gc_batch_t *batch);
    /* Optional: the part's own test of its gyroscope, at rest. Takes up to five seconds and leaves the part to be set up again. */
    int (*self_test)(gc_sensor_t *sensor, gc_self_test_t *result);
} gc_part_t;

struct gc_sensor {
    const gc_part_t *part;
    const gc_port_t *port;
    uint8_t address;
    uint8_t other_address; /* of the part's second die, where it has one */
    const gc_spi_t *spi[2]; /* the part's, where the port has SPI; else NULL */
    const gc_odr_t *odr;
    const gc_range_t *range;
    const gc_accel_t *accel;
    unsigned low_pass;
    double odr_hz;    /* nominal */
    double period_us; /* output period by the part's own clock */
    double full_scale_dps;
    double lsb_dps;
    double lsb_g;
    uint8_t written[GC_WATCHED_MAX]; /* values written to the watched registers */
    uint64_t config_checked_us;
    uint64_t looked_us; /* when the bus was last asked whether data are ready */
    uint64_t fresh_us; /* when data were last ready */
    unsigned batch;    /* samples between two readings of the FIFO; 0 = it is not used */
    bool data_wait;    /* a look has cleared the flag of data that were not read since; for parts whose flag a look clears */
    uint64_t temp_us;  /* when the temperature was last read, for parts where that takes a transfer of its own */
    bool fifo_broken;  /* the FIFO must be started again */
    gc_sample_t partial; /* the FIFO's time slot in progress; its temperature is the latest */
    uint8_t partial_slot, partial_has; /* number of the slot, and the words of it that have come */
    uint8_t whole_slot; /* that of the latest whole sample; beyond 3 = none */
    gc_stamps_t stamps;
};

/* Returns the output data rate in Hz that serves `rate_hz`: the rate itself if it is one of the part's, else the first one from
   polled_from_hz on that is a fifth above it, or 0 if there is none. */
double gc_part_odr_for(const gc_part_t *part, double rate_hz);
/* Returns true if the part has this range of the accelerometer, or this low-pass at the output data rate. 0 always is one. */
bool gc_part_accel_ok(const gc_part_t *part, double accel_g);
bool gc_part_low_pass_ok(const gc_part_t *part, double odr_hz, double low_pass);
bool gc_part_full_scale_ok(const gc_part_t *part, double full_scale_dps);
/* Whether the part may have the address; on SPI, which has none, whether it speaks that. */
bool gc_part_may_be_at(const gc_part_t *part, const gc_port_t *port, uint8_t address);
/* Returns the first part of a list, which ends with NULL, of which that is so; NULL if there is none. */
const gc_part_t *gc_part_at(const gc_part_t *const *parts, const gc_port_t *port, uint8_t address);
/* Asks the part at the address which of a list it is. Returns GC_OK, GC_E_WRONG_ID (it is none of them) or an error of the bus. */
int gc_part_find(const gc_part_t *const *parts, const gc_port_t *port, uint8_t address, const gc_part_t **found);
/* Asks at each address that a part of the list may have, the usual ones first. Returns the first at which one of them answers, with
   that part; if none does, NULL and the first address asked, where a device then reports bus_nack until one does. On SPI the
   address is the part's usual one and means nothing. */
uint8_t gc_part_look(const gc_part_t *const *parts, const gc_port_t *port, const gc_part_t **found);

/* Sets the part up, which takes about 0.1 s. Returns GC_E_ARGUMENT for a set-up that the functions above do not allow, and
   GC_E_NO_SPI for a part that does not speak the port's SPI. */
int gc_sensor_init(gc_sensor_t *sensor, const gc_part_t *part, const gc_port_t *port, uint8_t address, const gc_setup_t *setup);
/* Returns 1 if new data wait, 0 if none do, negative on error. */
int gc_sensor_ready(gc_sensor_t *sensor);
/* Reads the flag and, where it is set, the sample. Every 0.5 s, and when data stay away, also checks that the part still has its
   settings. Errors: those of the bus, GC_E_CONFIG_LOST (call init again), GC_E_STALE (no data for three output periods). */
int gc_sensor_read(gc_sensor_t *sensor, gc_sample_t *sample);
/* After init; `batch` from 1 to the part's batch_max. */
int gc_sensor_fifo_begin(gc_sensor_t *sensor, unsigned batch);
/* Takes what the FIFO holds, as much as the batch has room for; what came before an error is there. Errors: as above, and
   GC_E_FIFO_TAG (words came damaged). After one, what the FIFO still held is lost. */
int gc_sensor_fifo_read(gc_sensor_t *sensor, gc_batch_t *batch);

/* Returns the mean temperature in degC from the sum of n readings in counts; NaN for n = 0. */
double gc_sensor_temp_c(const gc_part_t *part, int64_t sum, uint32_t n);

/* Runs the part's own test, after which it must be set up again. Returns GC_E_NO_SELF_TEST if it has none. */
int gc_sensor_self_test(gc_sensor_t *sensor, gc_self_test_t *result);

/* The functions from here on serve drivers. */
int16_t gc_sensor_word(uint8_t high, uint8_t low);
/* Three words in a row, by which of their bytes comes first. */
void gc_sensor_words_low_first(const uint8_t *data, int16_t out[3]);
void gc_sensor_words_high_first(const uint8_t *data, int16_t out[3]);
void gc_sensor_wait_us(const gc_sensor_t *sensor, uint64_t us);
int gc_sensor_write_reg(gc_sensor_t *sensor, uint8_t reg, uint8_t value);
/* Up to GC_WRITE_MAX bytes. */
int gc_sensor_write_regs(gc_sensor_t *sensor, uint8_t reg, const uint8_t *data, size_t n);
int gc_sensor_read_regs(gc_sensor_t *sensor, uint8_t reg, uint8_t *data, size_t n);
/* Reads the id of a die, 0 or 1, and compares it. Returns GC_E_WRONG_ID if it is another, and GC_E_BUS_NACK if nothing answers. */
int gc_sensor_check_id(gc_sensor_t *sensor, unsigned die, uint8_t reg, uint8_t id);
/* On SPI: sets the bits by which the part no longer takes the bus for I2C. A reset clears them. */
int gc_sensor_leave_i2c(gc_sensor_t *sensor);
/* Looks every look_us until the bits of `mask` read `wanted`. Returns GC_E_RESET_TIMEOUT if they do not in time. */
int gc_sensor_wait_for_bits(gc_sensor_t *sensor, uint8_t reg, uint8_t mask, uint8_t wanted, uint64_t look_us, uint64_t timeout_us);
/* What `ready` returns where a look at the flag clears it. The reading clears data_wait. */
int gc_sensor_ready_once(gc_sensor_t *sensor, uint8_t reg, uint8_t flag);
/* Writes registers, each with its value, in this order. */
int gc_sensor_write_steps(gc_sensor_t *sensor, const uint8_t (*steps)[2], size_t n);
/* The same of the second die. */
int gc_sensor_write_other(gc_sensor_t *sensor, uint8_t reg, uint8_t value);
int gc_sensor_read_other(gc_sensor_t *sensor, uint8_t reg, uint8_t *data, size_t n);
/* Sets the bits of `mask` to those of `value`. */
int gc_sensor_change_bits(gc_sensor_t *sensor, uint8_t reg, uint8_t mask, uint8_t value);
/* Returns error_if_other if a watched register does not hold what was written to it. */
int gc_sensor_check_config(gc_sensor_t *sensor, int error_if_other);

#ifdef __cplusplus
}
#endif

#endif
