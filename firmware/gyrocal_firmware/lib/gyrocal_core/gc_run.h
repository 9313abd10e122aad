/* A run: the known motion of the table, and the sums over the samples. */
#ifndef GC_RUN_H
#define GC_RUN_H

#include "gc_baseline.h"
#include "gc_face.h"
#include "gc_settings.h"
#include "gc_tell.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GC_GAP_PERIODS 1.5 /* if two samples are further apart, one between them is missing */

typedef struct {
    uint64_t t_us;
    uint64_t number; /* since boot */
    uint32_t missed; /* number of samples missing before this one */
    gc_sample_t raw;
} gc_taken_t;

/* Readings of the axis in which a bit may never change. */
typedef struct {
    uint16_t any, all; /* bits that were 1 in any reading, and in all of them */
    int16_t min, max;
    uint32_t changes;
} gc_bits_t;

/* Readings that equal the one before them, or the one before that, on all axes. Noise makes both about equally frequent. */
typedef struct {
    gc_sample_t last[2];
    uint32_t equal[2];
    uint32_t row, longest_row; /* readings in a row that equal the one before them */
} gc_repeats_t;

typedef struct {
    bool automatic;
    bool complete; /* ended, long enough and in the right direction: half of a pair */
    bool opposed;  /* the reading opposed the true rate */
    int face;      /* +1 up, -1 down */
    gc_settings_t settings;
    const gc_part_t *part;
    double full_scale_dps;
    double lsb_dps;
    double lsb_g;
    double w_dps;   /* true rate about the sensed axis; NaN = unknown */
    uint32_t n;
    uint64_t first; /* sample number since boot */
    uint64_t first_us;
    uint64_t last_us;
    int16_t last[3];
    int64_t sum[3];
    int64_t sum_sq_diff[3];
    int64_t acc_sum[3];
    int64_t temp_sum;
    int64_t turn; /* trapezoid of the axis, 2 counts x microseconds */
    uint32_t clipped;
    uint32_t missed; /* number of missing samples */
    gc_bits_t bits, latest_bits; /* of the whole run, and of its latest readings */
    bool stuck_bit;
    gc_repeats_t repeats;
    uint16_t largest_diff; /* of successive readings */
    uint64_t sum_diff4[2]; /* of their fourth powers, exactly: low and high half */
    uint32_t still, still_longest; /* readings in a row that did not change, and for how long: */
    uint64_t still_since_us, still_longest_us;
    gc_baseline_t baseline;
    gc_face_t seconds; /* its first ones, by blocks, and its last turn */
    uint32_t n_at[GC_CHECKPOINTS];
    int64_t temp_at[GC_CHECKPOINTS];
} gc_run_t;

/* Returns the true rate in dps of a run with these settings; NaN if only its angle is known, or nothing. */
double gc_run_true_rate_dps(const gc_settings_t *settings, int face);
/* Begins a run. `first` is the number of the next sample. */
void gc_run_begin(gc_run_t *run, const gc_settings_t *settings, const gc_sensor_t *sensor, int face, bool automatic,
                  uint64_t first);
/* Completes the checkpoints before t_us. Call it before gc_run_add for the sample of that time. */
void gc_run_advance(gc_run_t *run, uint64_t t_us);
/* Adds a sample. Returns true at the run's first sample at full scale. */
bool gc_run_add(gc_run_t *run, const gc_taken_t *sample);
/* Ends the run and completes the checkpoints that its last sample reaches. */
void gc_run_end(gc_run_t *run);

double gc_run_seconds(const gc_run_t *run);
double gc_run_temp_c(const gc_run_t *run);
/* Returns whether a low bit did not change over the run, or over 64 changes of the reading, although the reading moved over
   several of its steps. */
bool gc_run_has_stuck_bit(const gc_run_t *run);
/* Returns whether gravity along the axis contradicts the run's face; false if gravity is not along the axis. */
bool gc_run_face_is_wrong(const gc_run_t *run);
/* Returns whether the mean reading and the true rate have opposite signs. */
bool gc_run_is_opposed(const gc_run_t *run);

/* Sends an $ERR for a bit that did not change. Sends one too if more readings equal the one before them on all axes than noise
   explains. */
void gc_run_tell_faults(const gc_run_t *run, gc_teller_t *teller);
/* Sends a $RUN for the start or the end of a run. `next` is the number of the next sample. */
void gc_run_tell(const gc_run_t *run, gc_teller_t *teller, bool ended, uint64_t next);

#ifdef __cplusplus
}
#endif

#endif
