/* What speaks against an answer, as flags of gc_flags.h: by what its runs' readings show, and by the answer itself. */
#ifndef GC_JUDGE_H
#define GC_JUDGE_H

#include "gc_baseline.h"
#include "gc_flags.h"
#include "gc_run.h"

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A misfit above this says that the readings do not fit: 2.5 standard deviations of what `blocks` of noise alone show. */
#define GC_MISFIT_LIMIT(blocks) (1.0 + 2.5 / sqrt(2.0 * (blocks)))

/* The verdict on the last answer. */
typedef struct {
    double misfit; /* NaN: not judged yet */
    bool trusted;  /* the answer that corrects has no flag */
} gc_verdict_t;

/* clipped, direction, constant_reading, missed, and misfit for readings that no noise explains: a spike, a stuck bit. */
uint32_t gc_judge_run(const gc_run_t *run);
/* implausible, direction, misfit; a misfit that is no number counts too. */
uint32_t gc_judge_answer(const gc_answer_t *answer, double blocks);

#ifdef __cplusplus
}
#endif

#endif
