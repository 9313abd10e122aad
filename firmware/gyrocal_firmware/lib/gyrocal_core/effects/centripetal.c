/* The part sits off the axis of rotation: w^2. */
#include "../gc_calibration.h"

GC_EFFECT(centripetal);

GC_EFFECT(centripetal) {
    (void)arg;
    return in->rate_dps * in->rate_dps;
}
