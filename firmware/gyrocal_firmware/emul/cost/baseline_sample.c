/* One sample into the baseline. */
#include "cost.h"

#include "gc_baseline.h"

const unsigned cost_times = 1000;

static gc_baseline_t baseline;

void cost_prepare(void) {
    gc_baseline_begin(&baseline, 145.0);
}

void cost_act(void) {
    static uint64_t t_us;
    t_us += 6897u;
    gc_baseline_advance(&baseline, t_us);
    gc_baseline_add(&baseline, t_us, (int16_t)(8900 + (int)(t_us % 13u)));
}
