/* Scale differs between the two senses of rotation: |w|. */
#include "../gc_calibration.h"

GC_EFFECT(scale_asymmetry);

GC_EFFECT(scale_asymmetry) {
    (void)arg;
    return in->rate_dps < 0.0f ? -in->rate_dps : in->rate_dps;
}
