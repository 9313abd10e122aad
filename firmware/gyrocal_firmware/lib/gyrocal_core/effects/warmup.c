/* The part warms up after power-on: exp(-p/tau). arg[0] = tau_s. */
#include "../gc_calibration.h"
#include "../gc_math.h"

GC_EFFECT(warmup);

GC_EFFECT(warmup) {
    return gc_exp(-in->power_on_s / arg[0]);
}
