#include "gc_sampler.h"

#include "gc_error.h"

#include <math.h>
#include <string.h>

#define START_UP_US 100000u  /* of the slowest part */
#define RETRY_US 1000000u    /* time between attempts to set the sensor up */
#define GIVE_UP_US 500000u   /* after this time without a good sample the sensor is set up again */
#define IDLE_SLICE_US 20000u /* while there is no sensor, commands are read this often */
#define READY_POLL_US 100u   /* time between two looks at the data-ready flag: one transfer on a bus of 400 kHz */
#define MOST_MISSED 4294967295.0 /* the largest uint32_t */
#define READS_A_STEP 8u /* readings of the FIFO in one step; samples that come faster wait for the next step */

static uint64_t now_us(const gc_sampler_t *sampler) {
    return sampler->port->now_us(sampler->port->context);
}

void gc_sampler_init(gc_sampler_t *sampler, gc_teller_t *teller, const gc_settings_t *settings, const gc_part_t *part,
                     uint8_t address) {
    memset(sampler, 0, sizeof *sampler);
    sampler->teller = teller;
    sampler->port = teller->port;
    sampler->settings = settings;
    sampler->part = part;
    sampler->address = address;
}

static int begin_sensor(gc_sampler_t *sampler) {
    const gc_settings_t *settings = sampler->settings;
    const gc_setup_t setup = {.odr_hz = gc_part_odr_for(sampler->part, settings->rate_hz),
                              .full_scale_dps = settings->full_scale_dps,
                              .accel_g = settings->accel_g,
                              .low_pass = (unsigned)settings->low_pass};
    int error = gc_sensor_init(&sampler->sensor, sampler->part, sampler->port, sampler->address, &setup);
    if (error == GC_OK && settings->fifo > 0.0) {
        error = gc_sensor_fifo_begin(&sampler->sensor, (unsigned)settings->fifo);
    }
    return error;
}

static int find_part(gc_sampler_t *sampler) {
    const int error = gc_part_find(sampler->parts, sampler->port, sampler->address, &sampler->part);
    sampler->other = error == GC_OK;
    return error;
}

/* On SPI the part is asked first, because a set-up writes to whatever part is there; once more after its start-up, if that goes on. */
static int find_and_begin(gc_sampler_t *sampler) {
    const gc_port_t *port = sampler->port;
    const gc_part_t *before = sampler->part;
    if (sampler->parts != NULL && port->spi != NULL) {
        int error = find_part(sampler);
        if (error == GC_E_BUS_NACK) {
            port->wait_until_us(port->context, now_us(sampler) + START_UP_US);
            error = find_part(sampler);
        }
        if (error != GC_OK || sampler->part != before) {
            return error;
        }
        sampler->other = false;
    }
    const int error = begin_sensor(sampler);
    return sampler->parts != NULL && (error == GC_E_WRONG_ID || error == GC_E_ARGUMENT) ? find_part(sampler) : error;
}

void gc_sampler_set_up(gc_sampler_t *sampler) {
    const int error = find_and_begin(sampler);
    const uint64_t now = now_us(sampler);
    sampler->ready = error == GC_OK && !sampler->other;
    sampler->error = GC_OK;
    sampler->good_us = now;
    sampler->epoch_us = now;
    sampler->tick = 0;
    sampler->fifo_known = false;
    sampler->gap = false;
    sampler->retry_us = now + RETRY_US;
    if (error != GC_OK) {
        gc_tell_error(sampler->teller, error);
    }
}

void gc_sampler_begin_anew(gc_sampler_t *sampler) {
    gc_sampler_set_up(sampler);
    sampler->sample_us = 0;
}

static bool is_polled(const gc_sampler_t *sampler) {
    return sampler->settings->rate_hz != sampler->sensor.odr_hz;
}

/* ---- waiting ---- */

static void wait_sample(const gc_sampler_t *sampler, uint64_t due_us) {
    const gc_port_t *port = sampler->port;
    (port->wait_sample_us != NULL ? port->wait_sample_us : port->wait_until_us)(port->context, due_us);
}

/* Takes a sample at once if its tick is over; of several such ticks, only the last counts. */
static void wait_for_tick(gc_sampler_t *sampler) {
    const double period_us = 1e6 / sampler->settings->rate_hz;
    const uint64_t now = now_us(sampler);
    const uint64_t over = now > sampler->epoch_us ? (uint64_t)((double)(now - sampler->epoch_us) / period_us) : 0u;
    sampler->tick = over > sampler->tick ? over : sampler->tick + 1u;
    wait_sample(sampler, sampler->epoch_us + (uint64_t)((double)sampler->tick * period_us + 0.5));
    sampler->read_us = now_us(sampler);
}

/* The pin rises with the oldest of the data that wait, and the newest are read. */
static uint64_t edge_or(uint64_t rose_us, uint64_t looked_us, double period_us) {
    return rose_us > 0u && rose_us <= looked_us && (double)(looked_us - rose_us) < period_us ? rose_us : looked_us;
}

static void wait_for_data_ready(gc_sampler_t *sampler) {
    const gc_port_t *port = sampler->port;
    const double period_us = 1e6 / sampler->settings->rate_hz;
    const uint64_t start = now_us(sampler);
    uint64_t rose_us = 0;
    if (port->wait_ready_us != NULL) {
        rose_us = port->wait_ready_us(port->context, start + (uint64_t)(1.5 * period_us));
    } else {
        wait_sample(sampler, start + (uint64_t)(0.5 * period_us));
    }
    for (;;) {
        const uint64_t now = now_us(sampler);
        const int ready = gc_sensor_ready(&sampler->sensor);
        sampler->read_us = edge_or(rose_us, sampler->sensor.looked_us, period_us);
        if (ready != 0 || (double)(now - start) > 4.0 * period_us) {
            return; /* the reading reports an error if there is one */
        }
        rose_us = 0;
        port->wait_until_us(port->context, now + READY_POLL_US);
    }
}

static void wait_for_batch(gc_sampler_t *sampler) {
    const gc_port_t *port = sampler->port;
    const double batch_us = sampler->settings->fifo * sampler->sensor.period_us;
    if (port->wait_ready_us != NULL) {
        (void)port->wait_ready_us(port->context, now_us(sampler) + (uint64_t)(1.5 * batch_us));
    } else {
        wait_sample(sampler, sampler->batch.t_us + (uint64_t)batch_us);
    }
}

bool gc_sampler_wait(gc_sampler_t *sampler) {
    if (!sampler->ready) {
        sampler->port->wait_until_us(sampler->port->context, now_us(sampler) + IDLE_SLICE_US);
        if (now_us(sampler) >= sampler->retry_us && !sampler->other) {
            gc_sampler_set_up(sampler);
            sampler->resets++;
        }
        return false;
    }
    if (sampler->settings->fifo > 0.0) {
        wait_for_batch(sampler);
    } else if (is_polled(sampler)) {
        wait_for_tick(sampler);
    } else {
        wait_for_data_ready(sampler);
    }
    return true;
}

/* ---- reading ---- */

/* The newest sample was taken within a period before the reading; those since the newest of the last reading lie evenly, also behind
   samples that are lost where the part's own times tell how many. */
static void date_batch(gc_sampler_t *sampler) {
    const gc_batch_t *batch = &sampler->batch;
    const double period_us = sampler->sensor.period_us;
    const double left_us = period_us * batch->left;
    const double unsure_us = batch->left > 0u ? period_us : 0.0; /* `left` is within one */
    const double earliest_us = (double)batch->t_us - period_us - left_us - unsure_us;
    const double latest_us = (double)batch->until_us - left_us + unsure_us;
    double newest_us = 0.5 * (earliest_us + latest_us);
    sampler->step_us = period_us;
    if (sampler->fifo_known) {
        newest_us = fmin(fmax(sampler->newest_us + period_us * ((double)batch->n + batch->lost), earliest_us), latest_us);
        sampler->step_us = batch->lost > 0u ? period_us : (newest_us - sampler->newest_us) / batch->n;
    }
    sampler->newest_us = newest_us;
    sampler->fifo_known = true;
}

/* What the part left out by itself, without a gap in its FIFO, shows in the times of the samples. */
static void heed_gap(gc_sampler_t *sampler) {
    gc_batch_t *batch = &sampler->batch;
    batch->lost_known = batch->lost_known && sampler->gap;
    batch->lost = batch->lost_known ? batch->lost : 0u;
    sampler->fifo_known = sampler->fifo_known && (!sampler->gap || batch->lost_known);
    sampler->gap = false;
}

static void read_fifo(gc_sampler_t *sampler) {
    gc_batch_t *batch = &sampler->batch;
    sampler->read_error = gc_sensor_fifo_read(&sampler->sensor, batch);
    sampler->read_us = batch->t_us;
    sampler->gap = sampler->gap || batch->gap;
    if (batch->n > 0u) {
        heed_gap(sampler);
        date_batch(sampler);
    }
    if (batch->overrun) {
        sampler->overruns++;
        sampler->read_error = sampler->read_error == GC_OK ? GC_E_FIFO_OVERRUN : sampler->read_error;
    }
}

static void read_one(gc_sampler_t *sampler) {
    gc_batch_t *batch = &sampler->batch;
    sampler->read_error = gc_sensor_read(&sampler->sensor, &batch->sample[0]);
    batch->n = 0;
    batch->left = 0;
    batch->lost_known = false;
    if (sampler->read_error == GC_OK && batch->sample[0].fresh) {
        batch->n = 1;
        sampler->read_us = is_polled(sampler) ? sampler->sensor.looked_us : sampler->read_us;
        sampler->newest_us = (double)sampler->read_us;
    } else if (sampler->read_error == GC_OK) {
        sampler->stale++; /* a reading that was already taken is not new */
    }
}

void gc_sampler_begin_reading(gc_sampler_t *sampler) {
    sampler->reads = 0;
}

unsigned gc_sampler_read(gc_sampler_t *sampler) {
    if (sampler->settings->fifo > 0.0) {
        read_fifo(sampler);
    } else {
        read_one(sampler);
    }
    return sampler->batch.n;
}

static uint32_t missed_before(const gc_sampler_t *sampler, unsigned i, uint64_t t_us) {
    const double periods = 1e-6 * ((double)(t_us - sampler->sample_us) * sampler->settings->rate_hz);
    if (i == 0u && sampler->batch.lost_known) {
        return sampler->batch.lost;
    }
    return periods > GC_GAP_PERIODS ? (uint32_t)fmin(periods + 0.5, MOST_MISSED) - 1u : 0u;
}

void gc_sampler_take(gc_sampler_t *sampler, unsigned i, gc_taken_t *taken) {
    const double before_newest_us = sampler->step_us * (sampler->batch.n - 1u - i);
    const double t_us = sampler->newest_us - before_newest_us + 0.5;
    /* Time never decreases, even if a clock does. */
    taken->t_us = t_us > (double)sampler->sample_us ? (uint64_t)t_us : sampler->sample_us;
    taken->number = sampler->samples++;
    taken->missed = sampler->sample_us > 0u ? missed_before(sampler, i, taken->t_us) : 0u;
    taken->raw = sampler->batch.sample[i];
    sampler->missed += taken->missed;
    sampler->sample_us = taken->t_us;
}

bool gc_sampler_judge(gc_sampler_t *sampler) {
    const int error = sampler->read_error;
    if (error == GC_OK || error == GC_E_FIFO_OVERRUN) {
        sampler->good_us = sampler->read_us;
    }
    if (error != GC_OK && error != sampler->error) {
        gc_tell_error(sampler->teller, error);
    }
    sampler->error = error;
    sampler->stale += error == GC_E_STALE ? 1u : 0u;
    const uint64_t without_us = sampler->read_us > sampler->good_us ? sampler->read_us - sampler->good_us : 0u;
    if (error == GC_E_CONFIG_LOST || without_us > GIVE_UP_US) {
        gc_sampler_set_up(sampler);
        sampler->resets++;
    }
    return sampler->batch.left > 0u && ++sampler->reads < READS_A_STEP && (error == GC_OK || error == GC_E_FIFO_OVERRUN);
}
