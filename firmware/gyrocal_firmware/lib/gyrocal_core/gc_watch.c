#include "gc_watch.h"

#include <math.h>
#include <string.h>

#define STEADY_US 200000u
#define STEADY_FRACTION 0.03
#define GRAVITY_MIN_G 0.5

void gc_watch_init(gc_watch_t *watch) {
    memset(watch, 0, sizeof *watch);
    watch->armed = true;
}

void gc_watch_arm(gc_watch_t *watch) {
    watch->armed = true;
}

void gc_watch_disarm(gc_watch_t *watch) {
    watch->armed = false;
}

gc_watch_action_t gc_watch_look(gc_watch_t *watch, const gc_settings_t *settings, const gc_sensor_t *sensor, uint64_t t_us,
                                const gc_sample_t *sample) {
    const double acc_g = sensor->part->lsb_g * sample->acc[settings->axis];
    const int face = acc_g > GRAVITY_MIN_G ? 1 : acc_g < -GRAVITY_MIN_G ? -1 : 0;
    const double w_dps = settings->table_dps * face;
    const double off_dps = fabs(sensor->lsb_dps * sample->gyro[settings->axis] - w_dps);
    const bool steady = fabs(w_dps) > 0.0 && off_dps <= STEADY_FRACTION * fabs(w_dps);
    if (steady != watch->steady) {
        watch->steady = steady;
        watch->since_us = t_us;
    }
    if (!settings->automatic || t_us - watch->since_us < STEADY_US) {
        return GC_WATCH_NOTHING;
    }
    if (!steady) {
        watch->armed = true;
        return GC_WATCH_STOP;
    }
    if (!watch->armed) {
        return GC_WATCH_NOTHING;
    }
    return face > 0 ? GC_WATCH_START_UP : GC_WATCH_START_DOWN;
}
