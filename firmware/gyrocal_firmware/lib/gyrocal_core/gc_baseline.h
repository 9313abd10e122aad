/* The paper's baseline, eq. (9)-(10): scale and bias from the mean rates of two runs, by exact integer sums. */
#ifndef GC_BASELINE_H
#define GC_BASELINE_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GC_CHECKPOINTS 3u /* answers after 2, 4 and 6 s */
#define GC_CHECKPOINT_US(k) ((uint64_t)2000000u * ((k) + 1u))
#define GC_BLOCK_US 250000u

/* The answer of a method; NaN for a value that the method does not give. */
typedef struct {
    double scale;
    double scale_se;
    double bias_dps;
    double bias_se_dps;
    double misfit; /* 1 = adequate */
} gc_answer_t;

/* Sums over the readings of a run from its first sample on, in raw counts. */
typedef struct {
    uint32_t n;
    int64_t sum;
    int64_t sum_sq_diff; /* of differences between successive readings */
    /* Sums over the full blocks, less the run's first reading so that squares stay small. */
    int16_t origin;
    uint32_t blocks;
    int64_t block_samples;
    int64_t block_sum;
    double block_sum_sq; /* sum of (block sum)^2 / (block samples) */
} gc_baseline_sums_t;

typedef struct {
    double rate_hz;
    uint64_t first_us;
    uint64_t last_us;
    int16_t last;
    uint64_t block; /* the block in progress */
    uint32_t block_n;
    int64_t block_sum;
    gc_baseline_sums_t total;
    unsigned checkpoints; /* how many are complete */
    gc_baseline_sums_t at[GC_CHECKPOINTS];
} gc_baseline_t;

void gc_baseline_begin(gc_baseline_t *run, double rate_hz);
/* Completes the checkpoints before t_us. Call it before gc_baseline_add for the sample of that time. */
void gc_baseline_advance(gc_baseline_t *run, uint64_t t_us);
void gc_baseline_add(gc_baseline_t *run, uint64_t t_us, int16_t count);
/* Ends the run. Completes the checkpoints that the last sample plus 1.5 nominal periods reaches. */
void gc_baseline_end(gc_baseline_t *run);

/* Returns the white variance of one sample in counts^2, from successive differences; NaN for fewer than two samples. */
double gc_baseline_white_variance(const gc_baseline_sums_t *sums);

/* Solves for scale and bias from runs a and b at true rates w_a and w_b (dps) about the sensed axis; one count is lsb_dps. Returns
   GC_OK, GC_E_TOO_SHORT, or GC_E_UNIDENTIFIED if the rates are equal. */
int gc_baseline_solve(const gc_baseline_sums_t *a, const gc_baseline_sums_t *b, double w_a_dps, double w_b_dps,
                      double lsb_dps, gc_answer_t *answer);
/* Takes the mean of a run at rest as the bias; the scale stays NaN. */
int gc_baseline_rest(const gc_baseline_sums_t *run, double lsb_dps, gc_answer_t *answer);

#ifdef __cplusplus
}
#endif

#endif
