#include "gc_face.h"

#include <math.h>
#include <string.h>

#define SHORT_HZ 16.0 /* means over 1/16 s show noise at long times: longer than a low-pass's correlation, shorter than an effect */
#define CORRELATED 2.5         /* standard errors above which noise counts as correlated */
#define FIRST_DOF (2.0 / 3.0)  /* degrees of freedom of a squared difference of white noise */
#define SECOND_DOF 0.52        /* the same of a squared second difference */
#define SECOND_SPREAD 1.35     /* standard deviation of their level, times the square root of the number of blocks */
#define LOWPASS (5.0 / 9.0)    /* the part that a mean of L samples takes from second differences, times n / (L - 1/L) */
#define MOST_LACKING 0.4       /* the largest part that is corrected for */
/* Readings later than this are not held against an answer: they tell of the weather rather than of the run's beginning. */
#define LATEST_US 60000000u
/* Nor are those of the last second, in which the table may have been stopped. */
#define STOPS_US 1000000u
#define MOST_VALUES (2u * GC_CHECKPOINTS * 2000000u / GC_BLOCK_US)

/* Time into the run at which so many turns are over. */
static uint64_t turned_us(const gc_face_t *face, uint32_t turns) {
    const double t_us = (double)turns * face->turn_us;
    return t_us < LATEST_US + 1.0 ? (uint64_t)t_us : UINT64_MAX;
}

void gc_face_begin(gc_face_t *face, double rate_hz, double w_dps) {
    memset(face, 0, sizeof *face);
    face->rate_hz = rate_hz;
    face->turn_us = fabs(w_dps) > 0.0 ? 360e6 / fabs(w_dps) : 0.0;
    face->next_turn_us = face->turn_us > 0.0 ? turned_us(face, 1u) : UINT64_MAX;
    face->short_samples = (uint32_t)(rate_hz / SHORT_HZ + 0.5);
    if (face->short_samples == 0u) {
        face->short_samples = 1u;
    }
}

static void add_to_short(gc_face_t *face, gc_face_block_t *block, int16_t count) {
    face->short_sum[0] += (int64_t)count - face->origin;
    if (++face->short_n < face->short_samples) {
        return;
    }
    if (++face->shorts > 2u) {
        const int64_t second = face->short_sum[0] - 2 * face->short_sum[1] + face->short_sum[2];
        block->second_sq += second * second;
        block->second_n++;
    }
    face->short_sum[2] = face->short_sum[1];
    face->short_sum[1] = face->short_sum[0];
    face->short_sum[0] = 0;
    face->short_n = 0;
}

static void add_to_turns(gc_face_t *face, uint64_t since_us, int16_t count) {
    while (since_us >= face->next_turn_us) {
        face->turn[0] = face->turn[1];
        face->turn[1] = face->turn[2];
        face->turn[2] = face->total;
        face->next_turn_us = turned_us(face, ++face->turns + 1u);
    }
    face->since_us = since_us;
    face->total.n++;
    face->total.sum += (int64_t)count - face->origin;
}

uint32_t gc_face_last_turn(const gc_face_t *face, uint64_t after_us, double *mean) {
    for (unsigned back = 0; back < 2u && face->turns > back; back++) {
        const gc_face_sum_t *begin = &face->turn[1u - back];
        const gc_face_sum_t *end = &face->turn[2u - back];
        if (turned_us(face, face->turns - back) + STOPS_US > face->since_us) {
            continue;
        }
        if (end->n == begin->n || turned_us(face, face->turns - back - 1u) < after_us) {
            return 0u;
        }
        *mean = (double)(end->sum - begin->sum) / (double)(end->n - begin->n) + (double)face->origin;
        return end->n - begin->n;
    }
    return 0u;
}

void gc_face_add(gc_face_t *face, uint64_t t_us, int16_t count) {
    if (!face->begun) {
        face->first_us = t_us;
        face->origin = count;
    }
    add_to_turns(face, t_us - face->first_us, count);
    const uint64_t number = (t_us - face->first_us) / GC_BLOCK_US;
    if (number >= GC_FACE_BLOCKS) {
        return;
    }
    gc_face_block_t *block = &face->block[number];
    if (face->begun) {
        const int64_t first = (int64_t)count - face->last;
        block->first_sq += first * first;
        block->first_n++;
    }
    block->n++;
    block->sum += (int32_t)count - face->origin;
    add_to_short(face, block, count);
    face->begun = true;
    face->last = count;
}

bool gc_face_has(const gc_face_t *face, unsigned block) {
    return 2.0 * 1e6 * (double)face->block[block].n >= face->rate_hz * GC_BLOCK_US;
}

static void insert(double *values, unsigned n, double value) {
    for (; n > 0u && values[n - 1u] > value; n--) {
        values[n] = values[n - 1u];
    }
    values[n] = value;
}

static double median(const double *values, unsigned n) {
    return n % 2u == 1u ? values[n / 2u] : 0.5 * (values[n / 2u - 1u] + values[n / 2u]);
}

/* The median of a chi-square variable divided by its mean (Wilson and Hilferty, 1931). */
static double median_of_mean(double dof) {
    const double root = 1.0 - 2.0 / (9.0 * dof);
    return root * root * root;
}

double gc_face_white_variance(const gc_face_t *a, const gc_face_t *b, unsigned blocks) {
    const gc_face_t *const faces[] = {a, b};
    double first[MOST_VALUES], second[MOST_VALUES];
    unsigned firsts = 0, seconds = 0;
    for (unsigned i = 0; i < 2u; i++) {
        for (unsigned k = 0; k < blocks; k++) {
            const gc_face_block_t *block = &faces[i]->block[k];
            if (gc_face_has(faces[i], k) && block->first_n > 0u) {
                insert(first, firsts++, (double)block->first_sq / (double)block->first_n);
            }
            if (gc_face_has(faces[i], k) && block->second_n > 0u) {
                insert(second, seconds++, (double)block->second_sq / (double)block->second_n);
            }
        }
    }
    if (firsts == 0u) {
        return NAN;
    }
    const double samples = a->rate_hz * (1e-6 * GC_BLOCK_US);
    const double shorts = (double)a->short_samples;
    const double white = median(first, firsts) / (2.0 * median_of_mean(FIRST_DOF * samples));
    if (seconds == 0u) {
        return white;
    }
    const double slow = median(second, seconds) / (6.0 * shorts * median_of_mean(SECOND_DOF * samples / shorts));
    if (!(slow > (1.0 + CORRELATED * SECOND_SPREAD / sqrt((double)seconds)) * white)) {
        return white;
    }
    const double excess = LOWPASS * (slow - white); /* L^2 = slow / white */
    const double most = MOST_LACKING * shorts * sqrt(slow * white);
    return slow / (1.0 - (excess < most ? MOST_LACKING * excess / most : MOST_LACKING));
}
