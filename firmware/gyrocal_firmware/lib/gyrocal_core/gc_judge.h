/* Raises the flags of gc_flags.h against an answer, from the readings of its runs and from the answer itself. */
#ifndef GC_JUDGE_H
#define GC_JUDGE_H

#include "gc_baseline.h"
#include "gc_flags.h"
#include "gc_run.h"

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The largest misfit of readings that fit. It lies 2.5 standard deviations above the misfit of `blocks` blocks of noise alone, so
   that about 6 in 1000 sound answers exceed it. */
#define GC_MISFIT_ERRORS 2.5
#define GC_MISFIT_LIMIT(blocks) (1.0 + GC_MISFIT_ERRORS / sqrt(2.0 * (blocks)))

/* A reading that is further off table_dps, as a fraction of it, is reported. A pair tells this apart from the bias, but not from the
   scale error of the sensor: this fraction is three times the 1 % of the datasheet. */
#define GC_TABLE_RATE_FRACTION 0.03

/* The verdict on the last answer of a pair or of a run at rest. */
typedef struct {
    double misfit; /* NaN: not judged yet */
    bool trusted;  /* the answer that corrects has no flag */
} gc_verdict_t;

/* Judges the readings of a run so far. Raises clipped, direction, constant_reading and missed, and misfit for a spike or a stuck
   bit, which noise does not explain. Returns a mask of gc_flag. */
uint32_t gc_judge_run(const gc_run_t *run);
/* Judges an answer from `blocks` block means of both runs together. Raises implausible, direction and misfit; a misfit of NaN
   raises it too. Returns a mask of gc_flag. */
uint32_t gc_judge_answer(const gc_answer_t *answer, double blocks);

#ifdef __cplusplus
}
#endif

#endif
