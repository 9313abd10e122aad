/* A tone fixed to the table's angle: sin(n theta) and -cos(n theta), nothing where the table rests.
   arg[0] = n, periods a turn; arg[1] = 0 for the sine, 1 for the cosine. */
#include "../gc_calibration.h"
#include "../gc_math.h"

GC_EFFECT(order_tone);

GC_EFFECT(order_tone) {
    const float turns = arg[0] * in->theta_turn;
    if (in->rate_dps == 0.0f) { return 0.0f; }
    return arg[1] == 0.0f ? gc_sin_turn(turns) : -gc_cos_turn(turns);
}
