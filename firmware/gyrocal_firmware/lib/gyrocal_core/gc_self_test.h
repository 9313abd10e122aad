/* What drivers need for the self-test of a part that moves its own masses. */
#ifndef GC_SELF_TEST_H
#define GC_SELF_TEST_H

#include "gc_sensor.h"

#ifdef __cplusplus
extern "C" {
#endif

/* How a part that moves its own masses is tested. The limits are those that the result holds already. */
typedef struct {
    const uint8_t (*still)[2]; /* registers and values for the rate and the range of the test */
    size_t stills;
    const uint8_t (*moving)[2]; /* those that begin to move them */
    size_t movings;
    uint32_t settle_us;
    unsigned samples;
    double lsb_dps;
} gc_moving_test_t;

/* Sets the limits of a change that are those of all axes. */
void gc_self_test_limit(gc_self_test_t *result, double least_dps, double most_dps);
/* InvenSense's limits: a change of at least half of the one at the factory, which `code` tells; 60 dps where it tells none. Readings
   at rest within 20 dps. */
void gc_self_test_limit_by_code(gc_self_test_t *result, const uint8_t code[3]);
/* Reads the rates at rest and again while the part moves its own masses, and judges the change. */
int gc_self_test_by_change(gc_sensor_t *sensor, const gc_moving_test_t *test, gc_self_test_t *result);

#ifdef __cplusplus
}
#endif

#endif
