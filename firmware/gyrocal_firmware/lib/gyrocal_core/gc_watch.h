/* The automatic watcher decides when a run should begin and end, from a table that turns steadily in one of its faces.
 *
 * It requires a steady rate, but not the stated one, because scale and bias are still unknown.
 */
#ifndef GC_WATCH_H
#define GC_WATCH_H

#include "gc_sensor.h"
#include "gc_settings.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    GC_WATCH_NOTHING,
    GC_WATCH_START_UP,
    GC_WATCH_START_DOWN,
    GC_WATCH_STOP,
    GC_WATCH_OPPOSED /* the table turns steadily against what face and rate say; reported once */
} gc_watch_action_t;

typedef struct {
    bool armed; /* a run may begin: the table was not steady since the last one ended */
    /* The window in progress. */
    uint64_t window_us; /* its first sample's time */
    uint32_t n;
    int16_t last;
    int64_t sum, sum_sq_diff, acc_sum;
    /* The last whole one; NaN and 0 before. */
    double rate_dps;
    int face; /* +1 up, -1 down by gravity along the axis, 0 neither */
    /* The stretch of windows that agree with its first. */
    double stretch_dps;
    int stretch_face;
    unsigned agree, differ; /* windows: in the stretch, and in a row since that are not */
    bool opposed_told;
} gc_watch_t;

void gc_watch_init(gc_watch_t *watch);
void gc_watch_arm(gc_watch_t *watch);
/* Prevents a run until the table was unsteady. */
void gc_watch_disarm(gc_watch_t *watch);
bool gc_watch_is_steady(const gc_watch_t *watch);
gc_watch_action_t gc_watch_look(gc_watch_t *watch, const gc_settings_t *settings, const gc_sensor_t *sensor, uint64_t t_us,
                                const gc_sample_t *sample);

#ifdef __cplusplus
}
#endif

#endif
