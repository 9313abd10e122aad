/* Bias drifts within a power cycle: p, the time since power-on in seconds. */
#include "../gc_calibration.h"

GC_EFFECT(drift);

GC_EFFECT(drift) {
    (void)arg;
    return in->power_on_s;
}
