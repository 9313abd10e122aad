/* Sums over a face's first 6 s in blocks of 0.25 s, from which the uncertainty of its answer follows, and over its last whole turn,
 * which shows whether the readings stayed where they were.
 *
 * The sums are exact integers in raw counts. FaceSums and last_turn in
 * host/gyrocal/calibration/uncertainty.py are the twins.
 */
#ifndef GC_FACE_H
#define GC_FACE_H

#include "gc_baseline.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GC_FACE_BLOCKS ((unsigned)(GC_CHECKPOINT_US(GC_CHECKPOINTS - 1u) / GC_BLOCK_US))

typedef struct {
    uint16_t n;
    uint16_t first_n;
    uint16_t second_n;
    int32_t sum;       /* sum of count - origin */
    int64_t first_sq;  /* sum of squared differences of successive samples */
    int64_t second_sq; /* sum of squared second differences of sums over 1/16 s */
} gc_face_block_t;

typedef struct {
    uint32_t n;
    int64_t sum; /* of count - origin */
} gc_face_sum_t;

typedef struct {
    double rate_hz;
    double turn_us; /* time of a turn; 0 = the table does not turn */
    uint64_t first_us;
    bool begun;
    int16_t origin;
    int16_t last;
    uint32_t short_samples; /* of 1/16 s */
    uint32_t short_n;
    int64_t short_sum[3]; /* the sum in progress and the two before it */
    uint32_t shorts;
    gc_face_sum_t total;   /* until now */
    gc_face_sum_t turn[3]; /* until the ends of the last three whole turns, the last one last */
    uint32_t turns;
    uint64_t next_turn_us; /* time into the run at which the next one is over */
    uint64_t since_us;     /* of the last sample */
    gc_face_block_t block[(GC_CHECKPOINTS * 2000000u) / GC_BLOCK_US];
} gc_face_t;

/* Begins a face at true rate w_dps; NaN = unknown. */
void gc_face_begin(gc_face_t *face, double rate_hz, double w_dps);
/* Adds a sample. Blocks hold the first 6 s, turns the first 60 s. */
void gc_face_add(gc_face_t *face, uint64_t t_us, int16_t count);

/* Returns the number of samples of the last whole turn that was over a second before the last sample, and their mean in counts as
   *mean; 0 if it began before after_us. */
uint32_t gc_face_last_turn(const gc_face_t *face, uint64_t after_us, double *mean);
/* Returns whether a block holds at least half of its nominal number of samples. */
bool gc_face_has(const gc_face_t *face, unsigned block);
/* Returns the variance in counts^2 of one sample's noise at long times, from the first `blocks` blocks of two faces of one sample
   rate; the mean of n samples has a variance n times smaller. NaN if there is no block. */
double gc_face_white_variance(const gc_face_t *a, const gc_face_t *b, unsigned blocks);

#ifdef __cplusplus
}
#endif

#endif
