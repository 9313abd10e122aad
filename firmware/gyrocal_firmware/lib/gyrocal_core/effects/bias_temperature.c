/* The bias moves with temperature: (T - 25)^n. arg[0] = n: 1, 2 or 3. */
#include "../gc_calibration.h"

GC_EFFECT(bias_temperature);

GC_EFFECT(bias_temperature) {
    const float above_c = in->temp_c - 25.0f;
    return arg[0] == 1.0f ? above_c : arg[0] == 2.0f ? above_c * above_c : above_c * above_c * above_c;
}
