/* The automatic watcher: looks at the table and says when a run should begin and end. */
#ifndef GC_WATCH_H
#define GC_WATCH_H

#include "gc_sensor.h"
#include "gc_settings.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum { GC_WATCH_NOTHING, GC_WATCH_START_UP, GC_WATCH_START_DOWN, GC_WATCH_STOP } gc_watch_action_t;

typedef struct {
    bool steady;
    bool armed; /* a run may begin: the table was not steady since the last one ended */
    uint64_t since_us; /* it has been steady, or not, since */
} gc_watch_t;

void gc_watch_init(gc_watch_t *watch);
void gc_watch_arm(gc_watch_t *watch);
/* No run begins before the table was unsteady. */
void gc_watch_disarm(gc_watch_t *watch);
gc_watch_action_t gc_watch_look(gc_watch_t *watch, const gc_settings_t *settings, const gc_sensor_t *sensor, uint64_t t_us,
                                const gc_sample_t *sample);

#ifdef __cplusplus
}
#endif

#endif
