/* Acceleration passes for rate. arg[0] = axis of the acceleration, 0 x, 1 y, 2 z. */
#include "../gc_calibration.h"

GC_EFFECT(g_sensitivity);

GC_EFFECT(g_sensitivity) {
    return in->acc_g[(int)arg[0]];
}
