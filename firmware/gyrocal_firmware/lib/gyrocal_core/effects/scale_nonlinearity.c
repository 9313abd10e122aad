/* Scale depends on the rate: w^3. */
#include "../gc_calibration.h"

GC_EFFECT(scale_nonlinearity);

GC_EFFECT(scale_nonlinearity) {
    (void)arg;
    return in->rate_dps * in->rate_dps * in->rate_dps;
}
