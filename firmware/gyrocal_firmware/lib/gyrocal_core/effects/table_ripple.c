/* The table's speed ripples with its angle: w cos(k theta) and w sin(k theta).
   arg[0] = k, cycles a turn; arg[1] = 0 for the cosine, 1 for the sine. */
#include "../gc_calibration.h"
#include "../gc_math.h"

GC_EFFECT(table_ripple);

GC_EFFECT(table_ripple) {
    const float turns = arg[0] * in->theta_turn;
    return in->rate_dps * (arg[1] == 0.0f ? gc_cos_turn(turns) : gc_sin_turn(turns));
}
