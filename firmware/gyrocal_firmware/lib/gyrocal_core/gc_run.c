#include "gc_run.h"

#include "gc_error.h"

#include <math.h>
#include <string.h>

#define STUCK_BITS 4u     /* the lowest bits are watched; a reading must span four steps of a bit before it is judged */
#define STUCK_CHANGES 64u /* the reading must have changed this often before a bit is judged; chosen by judgement */
/* Readings are repeated if more of them equal the one before than REPEAT_RATIO times those that equal the last but one, by so many
   standard deviations, where the noise is at least one count. The low-pass makes neighbours on one axis up to 1.4 times as often
   equal as readings two apart; equality on all axes is far rarer. Noise of one count on one axis alone makes a row of 16 with a
   probability of 2e-7. Chosen by judgement. */
#define REPEAT_RATIO 1.5
#define REPEAT_SIGMAS 4.0
#define REPEAT_FRACTION 0.05 /* of the run at least, */
#define REPEAT_CLEARLY 10.0  /* or so many times those that equal the last but one */
#define REPEATS_IN_A_ROW 16u
#define GRAVITY_MIN_G 0.5 /* least component along the axis that shows a face: within 60 degrees of it */

double gc_run_true_rate_dps(const gc_settings_t *settings, int face) {
    return settings->turn_deg != 0.0 ? NAN : settings->table_dps * face;
}

static const gc_bits_t no_bits = {.any = 0, .all = 0xFFFFu, .min = INT16_MAX, .max = INT16_MIN};

void gc_run_begin(gc_run_t *run, const gc_settings_t *settings, const gc_sensor_t *sensor, int face, bool automatic,
                  uint64_t first) {
    memset(run, 0, sizeof *run);
    run->face = face;
    run->automatic = automatic;
    run->settings = *settings;
    run->part = sensor->part;
    run->full_scale_dps = sensor->full_scale_dps;
    run->lsb_dps = sensor->lsb_dps;
    run->lsb_g = sensor->lsb_g;
    run->w_dps = gc_run_true_rate_dps(settings, face);
    run->first = first;
    run->bits = run->latest_bits = no_bits;
    gc_baseline_begin(&run->baseline, settings->rate_hz);
    gc_face_begin(&run->seconds, settings->rate_hz, run->w_dps);
}

static void note_checkpoints(gc_run_t *run, unsigned before) {
    for (unsigned k = before; k < run->baseline.checkpoints; k++) {
        run->n_at[k] = run->n;
        run->temp_at[k] = run->temp_sum;
    }
}

void gc_run_advance(gc_run_t *run, uint64_t t_us) {
    const unsigned before = run->baseline.checkpoints;
    gc_baseline_advance(&run->baseline, t_us);
    note_checkpoints(run, before);
}

void gc_run_end(gc_run_t *run) {
    const unsigned before = run->baseline.checkpoints;
    gc_baseline_end(&run->baseline);
    note_checkpoints(run, before);
}

static bool is_clipped(const gc_run_t *run, int16_t count) {
    return fabs((double)count) >= fmin(floor(run->full_scale_dps / run->lsb_dps), INT16_MAX);
}

/* Adds the difference between the last reading and this one. */
static void note_change(gc_run_t *run, uint64_t t_us, int16_t count) {
    const int32_t diff = (int32_t)count - run->last[run->settings.axis];
    const uint16_t size = (uint16_t)(diff < 0 ? -diff : diff);
    const uint64_t diff_sq = (uint64_t)size * size;
    const uint64_t diff4 = diff_sq * diff_sq; /* below 2^64: a difference has 16 bits */
    run->largest_diff = size > run->largest_diff ? size : run->largest_diff;
    run->sum_diff4[0] += diff4;
    run->sum_diff4[1] += run->sum_diff4[0] < diff4 ? 1u : 0u;
    if (diff != 0) {
        run->bits.changes++;
        run->latest_bits.changes++;
        run->still = 0;
        run->still_since_us = t_us;
    }
    run->still++;
    run->still_longest = run->still > run->still_longest ? run->still : run->still_longest;
    const uint64_t still_us = t_us - run->still_since_us;
    run->still_longest_us = still_us > run->still_longest_us ? still_us : run->still_longest_us;
}

static bool is_stuck(const gc_bits_t *bits) {
    for (unsigned bit = 0; bit < STUCK_BITS && bits->changes >= STUCK_CHANGES; bit++) {
        const unsigned mask = 1u << bit;
        const bool constant = (bits->any & mask) == 0u || (bits->all & mask) != 0u;
        if (constant && bits->max - bits->min >= (int)(4u * mask)) {
            return true;
        }
    }
    return false;
}

static void note_bits(gc_bits_t *bits, int16_t count) {
    bits->any |= (uint16_t)count;
    bits->all &= (uint16_t)count;
    if (count < bits->min) {
        bits->min = count;
    }
    if (count > bits->max) {
        bits->max = count;
    }
}

/* The temperature does not count, because a part may measure it at another rate. */
static bool is_equal(const gc_sample_t *a, const gc_sample_t *b) {
    return memcmp(a->gyro, b->gyro, sizeof a->gyro) == 0 && memcmp(a->acc, b->acc, sizeof a->acc) == 0;
}

static void note_repeats(gc_repeats_t *repeats, uint32_t n, const gc_sample_t *raw) {
    for (unsigned i = 0; i < 2u; i++) {
        repeats->equal[i] += n > i && is_equal(raw, &repeats->last[i]) ? 1u : 0u;
    }
    repeats->row = n > 0u && is_equal(raw, &repeats->last[0]) ? repeats->row + 1u : 0u;
    repeats->longest_row = repeats->row > repeats->longest_row ? repeats->row : repeats->longest_row;
    repeats->last[1] = repeats->last[0];
    repeats->last[0] = *raw;
}

bool gc_run_add(gc_run_t *run, const gc_taken_t *sample) {
    const int axis = run->settings.axis;
    const int16_t *gyro = sample->raw.gyro;
    const int16_t count = gyro[axis];
    if (run->n == 0u) {
        run->first = sample->number;
        run->first_us = sample->t_us;
        run->still = 1;
        run->still_since_us = sample->t_us;
    } else {
        for (size_t i = 0; i < 3u; i++) {
            const int64_t diff = (int64_t)gyro[i] - run->last[i];
            run->sum_sq_diff[i] += diff * diff;
        }
        run->turn += ((int64_t)run->last[axis] + count) * (int64_t)(sample->t_us - run->last_us);
        note_change(run, sample->t_us, count);
        run->missed += sample->missed;
    }
    for (size_t i = 0; i < 3u; i++) {
        run->sum[i] += gyro[i];
        run->acc_sum[i] += sample->raw.acc[i];
        run->last[i] = gyro[i];
    }
    run->temp_sum += sample->raw.temp;
    note_repeats(&run->repeats, run->n, &sample->raw);
    note_bits(&run->bits, count);
    note_bits(&run->latest_bits, count);
    if (run->latest_bits.changes >= STUCK_CHANGES) {
        run->stuck_bit = run->stuck_bit || is_stuck(&run->latest_bits);
        run->latest_bits = no_bits;
    }
    run->last_us = sample->t_us;
    gc_baseline_add(&run->baseline, sample->t_us, count);
    gc_face_add(&run->seconds, sample->t_us, count);
    run->n++;
    if (!is_clipped(run, count)) {
        return false;
    }
    return run->clipped++ == 0u;
}

double gc_run_seconds(const gc_run_t *run) {
    return 1e-6 * (double)(run->last_us - run->first_us);
}

double gc_run_temp_c(const gc_run_t *run) {
    return gc_sensor_temp_c(run->part, run->temp_sum, run->n);
}

bool gc_run_has_stuck_bit(const gc_run_t *run) {
    return run->stuck_bit || is_stuck(&run->bits);
}

static bool has_repeats(const gc_run_t *run) {
    const double next = run->repeats.equal[0];
    const double after_next = run->repeats.equal[1];
    const bool many = next > REPEAT_RATIO * after_next + REPEAT_SIGMAS * sqrt(next + after_next);
    const bool clear = next - after_next > REPEAT_FRACTION * run->n || next > REPEAT_CLEARLY * after_next;
    return gc_baseline_white_variance(&run->baseline.total) >= 1.0 &&
           ((many && clear) || run->repeats.longest_row >= REPEATS_IN_A_ROW);
}

void gc_run_tell_faults(const gc_run_t *run, gc_teller_t *teller) {
    if (gc_run_has_stuck_bit(run)) {
        gc_tell_error(teller, GC_E_STUCK_BIT);
    }
    if (has_repeats(run)) {
        gc_tell_error(teller, GC_E_REPEATED);
    }
}

bool gc_run_face_is_wrong(const gc_run_t *run) {
    const double acc_g = run->n == 0u ? 0.0 : run->lsb_g * (double)run->acc_sum[run->settings.axis] / (double)run->n;
    return fabs(acc_g) > GRAVITY_MIN_G && acc_g * run->face < 0.0;
}

bool gc_run_is_opposed(const gc_run_t *run) {
    return (double)run->sum[run->settings.axis] * run->w_dps < 0.0;
}

void gc_run_tell(const gc_run_t *run, gc_teller_t *teller, bool ended, uint64_t next) {
    gc_sentence_t *s = gc_tell_begin(teller, "RUN");
    gc_sentence_text(s, "state", ended ? "end" : "start");
    gc_sentence_text(s, "face", gc_face_name(run->face));
    gc_settings_field(s, &run->settings, GC_SETTING_AXIS, NULL);
    gc_settings_field(s, &run->settings, GC_SETTING_TABLE_DPS, NULL);
    gc_settings_field(s, &run->settings, GC_SETTING_TURN_DEG, NULL);
    gc_sentence_uint(s, "n", run->n);
    gc_sentence_uint(s, "first", run->first);
    if (run->n > 0u) {
        gc_sentence_uint(s, "last", next - 1u);
    } else {
        gc_sentence_text(s, "last", NULL);
    }
    if (ended) {
        static const char *const names[] = {"mean_x_dps", "mean_y_dps", "mean_z_dps"};
        for (size_t i = 0; i < 3u; i++) {
            gc_sentence_real(s, names[i], run->n == 0u ? NAN : run->lsb_dps * (double)run->sum[i] / (double)run->n);
        }
        gc_sentence_real(s, "duration_s", run->n == 0u ? NAN : gc_run_seconds(run));
        gc_sentence_real(s, "temp_c", gc_run_temp_c(run));
        gc_sentence_uint(s, "clipped", run->clipped);
        gc_sentence_uint(s, "missed", run->missed);
    }
    gc_tell_end(teller);
}
