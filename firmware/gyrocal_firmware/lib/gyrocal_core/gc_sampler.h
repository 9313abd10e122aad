/* Takes samples from the sensor by timer, by data-ready, or in batches from its FIFO, and gives each sample its time.
 * A failure of the sensor is reported, and the sensor is set up again.
 *
 *     if (gc_sampler_wait(&sampler)) {
 *         gc_sampler_begin_reading(&sampler);
 *         do {
 *             const unsigned n = gc_sampler_read(&sampler);
 *             for (unsigned i = 0; i < n; i++) {
 *                 gc_sampler_take(&sampler, i, &sample);
 *             }
 *         } while (gc_sampler_judge(&sampler));
 *     }
 */
#ifndef GC_SAMPLER_H
#define GC_SAMPLER_H

#include "gc_run.h"
#include "gc_sensor.h"
#include "gc_settings.h"
#include "gc_tell.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    gc_teller_t *teller;
    const gc_port_t *port;
    const gc_settings_t *settings;
    const gc_part_t *part;
    const gc_part_t *const *parts; /* the part may be any of these; NULL = it is known */
    bool other; /* the part is another than was thought, and nobody has checked the settings against it */
    uint8_t address;
    gc_sensor_t sensor;
    bool ready;        /* the sensor is set up */
    int error;         /* of the current failure, which is reported once */
    uint64_t good_us;  /* last time that a sample came */
    uint64_t retry_us; /* when to set the sensor up again */
    uint64_t epoch_us; /* ticks of the sample timer are counted from here */
    uint64_t tick;     /* of the last sample */
    uint64_t samples;  /* taken since boot */
    uint64_t sample_us; /* time of the last sample; 0 = none at these settings */

    uint64_t read_us; /* time of the last reading */
    int read_error;   /* its result */
    gc_batch_t batch; /* its samples */
    unsigned reads;   /* successive readings of the FIFO */
    double newest_us, step_us; /* when its last sample was taken, how far apart they are */
    bool gap;        /* samples are missing since then */
    bool fifo_known; /* newest_us is known, and no sample is missing since */

    uint32_t stale;    /* readings that were not new */
    uint32_t resets;   /* times that the sensor had to be set up again */
    uint32_t missed;   /* number of missing samples */
    uint32_t overruns; /* times that the FIFO was full */
} gc_sampler_t;

/* Initialises the sampler without setting up the sensor. The settings must outlive it. */
void gc_sampler_init(gc_sampler_t *sampler, gc_teller_t *teller, const gc_settings_t *settings, const gc_part_t *part,
                     uint8_t address);
/* Sets the sensor up as the settings say. A failure is reported, and the set-up is tried again after a second. If another part of
   the list answers, the result is that part and `other`; the caller makes the settings fit and sets it up. */
void gc_sampler_set_up(gc_sampler_t *sampler);
/* Starts timing anew after a change of settings: the time since the last sample no longer counts. */
void gc_sampler_begin_anew(gc_sampler_t *sampler);

/* Begins a row of readings, whose number gc_sampler_judge limits. */
void gc_sampler_begin_reading(gc_sampler_t *sampler);
/* Waits until a sample or a batch should be read. Returns false if there is no sensor to read. */
bool gc_sampler_wait(gc_sampler_t *sampler);
/* Reads the sensor and returns the number of samples. */
unsigned gc_sampler_read(gc_sampler_t *sampler);
/* Gives sample i. Take the samples in order, each once. */
void gc_sampler_take(gc_sampler_t *sampler, unsigned i, gc_taken_t *taken);
/* Reports what went wrong. Returns true if the FIFO holds more and should be read again. */
bool gc_sampler_judge(gc_sampler_t *sampler);

#ifdef __cplusplus
}
#endif

#endif
