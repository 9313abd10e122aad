/* The table has not reached its rate: -w exp(-t/tau). arg[0] = tau_s. */
#include "../gc_calibration.h"
#include "../gc_math.h"

GC_EFFECT(spin_up);

GC_EFFECT(spin_up) {
    return -in->rate_dps * gc_exp(-in->t_s / arg[0]);
}
