/* Scale moves with temperature: (T - 25) w. */
#include "../gc_calibration.h"

GC_EFFECT(scale_temperature);

GC_EFFECT(scale_temperature) {
    (void)arg;
    return (in->temp_c - 25.0f) * in->rate_dps;
}
