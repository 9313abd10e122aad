/* Acceleration passes for rate. arg[0] = axis of the acceleration, 0 x, 1 y, 2 z. */
#include "../gc_calibration.h"

GC_EFFECT(g_sensitivity);

GC_EFFECT(g_sensitivity) {
    return arg[0] == 0.0f ? in->acc_g[0] : arg[0] == 1.0f ? in->acc_g[1] : in->acc_g[2];
}
