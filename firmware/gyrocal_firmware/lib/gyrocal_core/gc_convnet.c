#include "gc_convnet_layers.h"

#include <math.h>
#include <stddef.h>

#include "gc_error.h"
#include "gc_math.h"

uint32_t gc_convnet_columns(const gc_convnet_t *net, unsigned stage) {
    return net->stage_columns * (stage + 1u);
}

uint32_t gc_convnet_samples(const gc_convnet_t *net, unsigned stage) {
    return net->pool * gc_convnet_columns(net, stage);
}

uint32_t gc_convnet_first_times(const gc_convnet_t *net, unsigned stage) {
    return gc_convnet_columns(net, stage) - net->first.kernel + 1u;
}

uint32_t gc_convnet_second_times(const gc_convnet_t *net, unsigned stage) {
    return (gc_convnet_first_times(net, stage) - net->second.kernel + 1u) / net->second.pool;
}

static bool fits(const gc_convnet_t *net) {
    const unsigned last = GC_CONVNET_STAGES - 1u;
    return gc_convnet_columns(net, last) <= GC_CONVNET_MAX_COLUMNS && net->hidden <= GC_CONVNET_MAX_HIDDEN &&
           net->first.channels * gc_convnet_first_times(net, last) <= GC_CONVNET_MAX_ROWS &&
           net->second.channels * gc_convnet_second_times(net, last) <= GC_CONVNET_MAX_FEATURES &&
           net->first.kernel <= GC_CONVNET_MAX_TAPS && net->first.channels * net->second.kernel <= GC_CONVNET_MAX_TAPS &&
           net->first.channels * net->second.kernel * gc_convnet_second_times(net, last) <= GC_CONVNET_MAX_SUMS;
}

/* Of the readings of a column. */
typedef struct {
    int32_t sum, least, most;
} extent_t;

static extent_t extent(const int16_t *counts, uint32_t n) {
    extent_t found = {0, counts[0], counts[0]};
    const int16_t *const end = counts + n;
#if GC_HAS_HALFWORDS
    if (n >= 2u) {
        int16x2_t least = gc_halfwords_at(counts), most = least;
        for (; counts + 1 < end; counts += 2) {
            const int16x2_t both = gc_halfwords_at(counts);
            found.sum = __smlad(both, GC_HALFWORDS_OF_ONE, found.sum);
            least = gc_halfwords_smaller(least, both);
            most = gc_halfwords_larger(most, both);
        }
        const int16_t low = (int16_t)least, high = (int16_t)(least >> 16);
        const int16_t low_most = (int16_t)most, high_most = (int16_t)(most >> 16);
        found.least = low < high ? low : high;
        found.most = low_most > high_most ? low_most : high_most;
    }
#endif
    for (; counts < end; counts++) {
        const int32_t count = *counts;
        found.sum += count;
        found.least = count < found.least ? count : found.least;
        found.most = count > found.most ? count : found.most;
    }
    return found;
}

/* Finds the columns and the mean (counts). Returns GC_OK or GC_E_NET_RANGE. */
static int find_columns(const gc_convnet_t *net, const int16_t *counts, double sign, double lsb_dps, gc_convnet_work_t *work,
                        double *mean) {
    const uint32_t n_columns = gc_convnet_columns(net, work->stage);
    const int32_t pool = (int32_t)net->pool;
    const int32_t n = (int32_t)gc_convnet_samples(net, work->stage);
    int64_t off[GC_CONVNET_MAX_COLUMNS]; /* column - mean in counts times a divisor */
    int32_t total = 0;
    int32_t off_column = 0; /* the largest |sample - column| in counts times the pool */
    int64_t off_mean = 0;   /* the largest |off| */
    for (uint32_t i = 0; i < n_columns; i++, counts += pool) {
        const extent_t column = extent(counts, net->pool);
        const int32_t above = column.most * pool - column.sum;
        const int32_t below = column.sum - column.least * pool;
        off_column = above > off_column ? above : off_column;
        off_column = below > off_column ? below : off_column;
        off[i] = (int64_t)column.sum * n;
        total += column.sum;
    }
    for (uint32_t i = 0; i < n_columns; i++) {
        off[i] -= (int64_t)total * pool;
        off_mean = off[i] > off_mean ? off[i] : -off[i] > off_mean ? -off[i] : off_mean;
    }
    *mean = (double)total / (double)n;
    const double divisor = (double)pool * (double)n;
    const bool in_range = lsb_dps * (double)off_column <= (double)net->sample_range_dps * (double)pool &&
                          lsb_dps * (double)off_mean <= (double)net->column_range_dps * divisor;
    if (!in_range) {
        return GC_E_NET_RANGE;
    }
    gc_convnet_set_columns(net, work, off, sign * lsb_dps / (divisor * (double)net->unit_dps));
    return GC_OK;
}

int gc_convnet_begin(const gc_convnet_t *net, const int16_t *counts, unsigned stage, double lsb_dps, double w_dps,
                     gc_convnet_work_t *work) {
    const double sign = w_dps < 0.0 ? -1.0 : 1.0;
    if (!gc_cnn_same_rate((float)(sign * w_dps), net->table_dps)) {
        return GC_E_NET_RATE;
    }
    if (!fits(net)) {
        return GC_E_NET_MEMORY;
    }
    if (!(lsb_dps > 0.0)) {
        return GC_E_NET_RANGE;
    }
    work->parts = 0;
    work->stage = stage;
    work->w_dps = w_dps;
    double mean = 0.0;
    const int error = find_columns(net, counts, sign, lsb_dps, work, &mean);
    work->mean_dps = lsb_dps * mean - w_dps;
    return error;
}

static float within(float x, float limit) {
    return x > limit ? limit : x < -limit ? -limit : x;
}

bool gc_convnet_go_on(const gc_convnet_t *net, gc_convnet_work_t *work, gc_convnet_face_t *face) {
    if (!gc_convnet_next_part(net, work)) {
        return false;
    }
    work->out[1] = within(work->out[1], net->log_precision);
    const double unit_dps = (double)net->unit_dps;
    const double sign = work->w_dps < 0.0 ? -1.0 : 1.0;
    face->w_dps = work->w_dps;
    face->u_dps = work->mean_dps + sign * unit_dps * (double)work->out[0];
    face->precision = (double)gc_exp(work->out[1]) / (unit_dps * unit_dps);
    return true;
}

int gc_convnet_face(const gc_convnet_t *net, const int16_t *counts, unsigned stage, double lsb_dps, double w_dps,
                    gc_convnet_work_t *work, gc_convnet_face_t *face) {
    const int error = gc_convnet_begin(net, counts, stage, lsb_dps, w_dps, work);
    while (error == GC_OK && !gc_convnet_go_on(net, work, face)) {
    }
    return error;
}

void gc_convnet_merge(const gc_calibration_t *calibration, const gc_convnet_face_t *up, const gc_convnet_face_t *down,
                      gc_answer_t *answer) {
    double mean[2] = {0.0, 0.0};           /* mean of the prior: bias, scale */
    double root[3] = {0.0, 0.0, 0.0};      /* square root of its information: [0 1; . 2] */
    if (calibration != NULL && calibration->prior_mean != NULL && calibration->prior_sqrt_information != NULL) {
        /* the last triangle of a square root is the marginal information of the last parameters */
        const unsigned n = calibration->n_run_columns + calibration->n_shared_columns + 2u;
        const double *last = calibration->prior_sqrt_information + (size_t)n * n - 1u;
        mean[0] = calibration->prior_mean[n - 2u];
        mean[1] = calibration->prior_mean[n - 1u];
        root[0] = last[-(ptrdiff_t)n - 1];
        root[1] = last[-(ptrdiff_t)n];
        root[2] = last[0];
    }
    const double of_bias = root[0] * root[0];
    const double of_both = root[0] * root[1];
    const double of_scale = root[1] * root[1] + root[2] * root[2];
    const double u = up->precision;
    const double d = down->precision;
    const double bb = of_bias + u + d;
    const double bs = of_both + u * up->w_dps + d * down->w_dps;
    const double ss = of_scale + u * up->w_dps * up->w_dps + d * down->w_dps * down->w_dps;
    const double b = of_bias * mean[0] + of_both * mean[1] + u * up->u_dps + d * down->u_dps;
    const double s = of_both * mean[0] + of_scale * mean[1] + u * up->w_dps * up->u_dps + d * down->w_dps * down->u_dps;
    const double det = bb * ss - bs * bs; /* positive: the true rates differ */
    answer->bias_dps = (ss * b - bs * s) / det;
    answer->scale = (bb * s - bs * b) / det;
    answer->bias_se_dps = sqrt(ss / det);
    answer->scale_se = sqrt(bb / det);
}
