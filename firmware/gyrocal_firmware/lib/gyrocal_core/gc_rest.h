/* Runs that need no partner: a run at rest shows the bias of each axis, a turn of known angle then shows the scale. */
#ifndef GC_REST_H
#define GC_REST_H

#include "gc_kept.h"
#include "gc_pair.h"
#include "gc_run.h"
#include "gc_tell.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The bias of each axis by the last run at rest. */
typedef struct {
    struct {
        bool known;
        double bias_dps;
        double white_variance; /* of one sample, dps^2 */
        double bias_variance;
    } axis[3];
} gc_rest_t;

void gc_rest_end(gc_rest_t *rest, const gc_run_t *run, gc_teller_t *teller, gc_kept_t *kept, gc_verdict_t *verdict);
void gc_rest_end_turn(const gc_rest_t *rest, const gc_run_t *run, gc_teller_t *teller, gc_kept_t *kept);

#ifdef __cplusplus
}
#endif

#endif
