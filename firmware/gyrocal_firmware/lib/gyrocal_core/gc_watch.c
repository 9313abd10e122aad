#include "gc_watch.h"

#include <math.h>
#include <string.h>

/* All of these were chosen by judgement. */
#define WINDOW_US 100000u    /* readings are averaged over windows of this length, */
#define WINDOW_SAMPLES 4u    /* which hold at least this many */
#define STEADY_WINDOWS 4u    /* a run begins after so many windows that agree, */
#define UNSTEADY_WINDOWS 2u  /* and ends after so many in a row that differ */
#define BEGIN_FRACTION 0.01  /* windows agree within this fraction of the rate before a run, */
#define STAY_FRACTION 0.03   /* and within this one during a run, so that ripple and spin-up do not end it */
#define NOISE_SIGMAS 5.0     /* and within so many standard deviations of their noise, whichever is larger */
#define TURNING_FRACTION 0.5 /* a table slower than this fraction of the stated rate does not turn */
#define GRAVITY_MIN_G 0.5    /* least component along the axis that shows a face: within 60 degrees of it */

void gc_watch_init(gc_watch_t *watch) {
    memset(watch, 0, sizeof *watch);
    watch->armed = true;
    watch->rate_dps = NAN;
}

void gc_watch_arm(gc_watch_t *watch) {
    watch->armed = true;
}

void gc_watch_disarm(gc_watch_t *watch) {
    watch->armed = false;
}

bool gc_watch_is_steady(const gc_watch_t *watch) {
    return watch->agree >= STEADY_WINDOWS;
}

/* The largest difference between the means of two windows of one rate, in dps. */
static double tolerance_dps(const gc_watch_t *watch, const gc_sensor_t *sensor) {
    const double white_variance = (double)watch->sum_sq_diff / (2.0 * (double)(watch->n - 1u));
    const double noise_dps = sensor->lsb_dps * sqrt(2.0 * white_variance / (double)watch->n);
    const double fraction = gc_watch_is_steady(watch) ? STAY_FRACTION : BEGIN_FRACTION;
    return fraction * fabs(watch->stretch_dps) + NOISE_SIGMAS * noise_dps;
}

/* Adds a whole window to the stretch, or begins a new one with it. */
static void end_window(gc_watch_t *watch, const gc_settings_t *settings, const gc_sensor_t *sensor) {
    const double acc_g = sensor->lsb_g * (double)watch->acc_sum / (double)watch->n;
    watch->rate_dps = sensor->lsb_dps * (double)watch->sum / (double)watch->n;
    watch->face = acc_g > GRAVITY_MIN_G ? 1 : acc_g < -GRAVITY_MIN_G ? -1 : 0;
    const double least_dps = TURNING_FRACTION * fabs(settings->table_dps);
    const bool turns = watch->face != 0 && least_dps > 0.0 && fabs(watch->rate_dps) >= least_dps;
    const bool agrees = watch->agree > 0u && turns && watch->face == watch->stretch_face &&
                        fabs(watch->rate_dps - watch->stretch_dps) <= tolerance_dps(watch, sensor);
    if (agrees) {
        watch->agree++;
        watch->differ = 0;
        return;
    }
    watch->differ++;
    if (!gc_watch_is_steady(watch) || watch->differ >= UNSTEADY_WINDOWS) {
        watch->stretch_dps = watch->rate_dps;
        watch->stretch_face = watch->face;
        watch->agree = turns ? 1u : 0u;
        watch->differ = 0;
        watch->opposed_told = false;
    }
}

static gc_watch_action_t decide(gc_watch_t *watch, const gc_settings_t *settings) {
    if (!settings->automatic) {
        return GC_WATCH_NOTHING;
    }
    if (!gc_watch_is_steady(watch)) {
        watch->armed = true;
        return GC_WATCH_STOP;
    }
    if (!watch->armed) {
        return GC_WATCH_NOTHING;
    }
    if (settings->table_dps * watch->stretch_face * watch->stretch_dps > 0.0) {
        return watch->stretch_face > 0 ? GC_WATCH_START_UP : GC_WATCH_START_DOWN;
    }
    if (watch->opposed_told) {
        return GC_WATCH_NOTHING;
    }
    watch->opposed_told = true;
    return GC_WATCH_OPPOSED;
}

gc_watch_action_t gc_watch_look(gc_watch_t *watch, const gc_settings_t *settings, const gc_sensor_t *sensor, uint64_t t_us,
                                const gc_sample_t *sample) {
    const int16_t count = sample->gyro[settings->axis];
    gc_watch_action_t action = GC_WATCH_NOTHING;
    if (watch->n >= WINDOW_SAMPLES && t_us - watch->window_us >= WINDOW_US) {
        end_window(watch, settings, sensor);
        action = decide(watch, settings);
        watch->n = 0;
    }
    if (watch->n == 0u) {
        watch->window_us = t_us;
        watch->sum = 0;
        watch->sum_sq_diff = 0;
        watch->acc_sum = 0;
    } else {
        const int64_t diff = (int64_t)count - watch->last;
        watch->sum_sq_diff += diff * diff;
    }
    watch->n++;
    watch->sum += count;
    watch->acc_sum += sample->acc[settings->axis];
    watch->last = count;
    return action;
}
