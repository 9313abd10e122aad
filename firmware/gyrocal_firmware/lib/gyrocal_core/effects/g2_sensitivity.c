/* Vibration is rectified: a^2. arg[0] = axis of the acceleration, 0 x, 1 y, 2 z; 3 = all of it. */
#include "../gc_calibration.h"

GC_EFFECT(g2_sensitivity);

GC_EFFECT(g2_sensitivity) {
    const float *a = in->acc_g;
    for (unsigned axis = 0; axis < 3u; axis++) {
        if (arg[0] == (float)axis) {
            return a[axis] * a[axis];
        }
    }
    return a[0] * a[0] + a[1] * a[1] + a[2] * a[2];
}
