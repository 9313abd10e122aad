#include "gc_rest.h"

#include "gc_error.h"

#include <math.h>

#define ONE_G_TOLERANCE 0.2 /* deviation from 1 g, as a fraction, that a sensor at rest may show; chosen by judgement */

static void give(gc_teller_t *teller, gc_kept_t *kept, const gc_run_t *run, gc_method_t method, uint32_t flags,
                 const gc_answer_t *answer) {
    const gc_kept_answer_t entry = {
        .t_us = teller->port->now_us(teller->port->context),
        .first = run->first,
        .last = run->first + run->n - 1u,
        .seconds = gc_run_seconds(run),
        .temp_c = gc_run_temp_c(run),
        .answer = *answer,
        .method = (int32_t)method,
        .axis = run->settings.axis,
        .flags = flags,
    };
    gc_kept_add(kept, teller, &entry);
    gc_kept_correct_by(kept, &entry);
}

void gc_rest_end(gc_rest_t *rest, const gc_run_t *run, gc_teller_t *teller, gc_kept_t *kept, gc_verdict_t *verdict) {
    gc_answer_t answer;
    const int error = gc_baseline_rest(&run->baseline.total, run->lsb_dps, &answer);
    if (error != GC_OK) {
        gc_tell_error(teller, error);
        return;
    }
    const double n = (double)run->n;
    double acc_sq = 0.0;
    for (size_t i = 0; i < 3u; i++) {
        const double variance = run->lsb_dps * run->lsb_dps * (double)run->sum_sq_diff[i] / (2.0 * (n - 1.0));
        const double acc_g = run->lsb_g * (double)run->acc_sum[i] / n;
        rest->axis[i].known = true;
        rest->axis[i].bias_dps = run->lsb_dps * (double)run->sum[i] / n;
        rest->axis[i].white_variance = variance;
        rest->axis[i].bias_variance = variance / n;
        acc_sq += acc_g * acc_g;
    }
    if (fabs(sqrt(acc_sq) - 1.0) > ONE_G_TOLERANCE) {
        gc_tell_error(teller, GC_E_NOT_ONE_G);
    }
    const double blocks = (double)(run->last_us - run->first_us) / (double)GC_BLOCK_US;
    verdict->misfit = answer.misfit;
    const uint32_t flags = gc_judge_run(run) & ~(uint32_t)GC_FLAG_DIRECTION; /* the face does not matter at rest */
    give(teller, kept, run, GC_METHOD_REST, flags | gc_judge_answer(&answer, blocks), &answer);
}

void gc_rest_end_turn(const gc_rest_t *rest, const gc_run_t *run, gc_teller_t *teller, gc_kept_t *kept) {
    const int axis = run->settings.axis;
    if (!rest->axis[axis].known) {
        gc_tell_error(teller, GC_E_NO_REST);
        return;
    }
    if (run->n < 2u) {
        gc_tell_error(teller, GC_E_TOO_SHORT);
        return;
    }
    if (gc_run_face_is_wrong(run)) {
        gc_tell_error(teller, GC_E_FACE);
    }
    const double seconds = gc_run_seconds(run);
    const double true_deg = run->settings.turn_deg * run->face;
    const double measured_deg = run->lsb_dps * 0.5e-6 * (double)run->turn;
    const double period_s = seconds / (double)(run->n - 1u);
    const double bias_dps = rest->axis[axis].bias_dps;
    const double white_variance = rest->axis[axis].white_variance;
    const double bias_variance = rest->axis[axis].bias_variance;
    const gc_answer_t answer = {
        .scale = (measured_deg - bias_dps * seconds) / true_deg - 1.0,
        .scale_se = sqrt(white_variance * period_s * seconds + bias_variance * seconds * seconds) / fabs(true_deg),
        .bias_dps = bias_dps,
        .bias_se_dps = sqrt(bias_variance),
        .misfit = NAN,
    };
    const uint32_t flags = gc_judge_run(run) | (gc_judge_answer(&answer, 1.0) & ~(uint32_t)GC_FLAG_MISFIT); /* it has none */
    give(teller, kept, run, GC_METHOD_TURN, flags, &answer);
}
