#include "gc_pair.h"

#include "gc_error.h"

#include <math.h>
#include <string.h>

#define SAME_RATE 0.005 /* relative difference of the true rates of a pair; both are known, so they need not be equal */
#define FACE_S 0.25     /* time into a run after which gravity is compared with its face */

void gc_pair_init(gc_pair_t *pair, gc_teller_t *teller, gc_kept_t *kept, gc_verdict_t *verdict,
                  const gc_calibration_t *calibration, const gc_cnn_net_t *net) {
    memset(pair, 0, sizeof *pair);
    pair->teller = teller;
    pair->kept = kept;
    pair->verdict = verdict;
    pair->calibration = calibration;
    pair->model = calibration != NULL && gc_estimator_has_model(calibration);
    gc_net_open(&pair->net, net);
}

static const gc_run_t *partner(const gc_pair_t *pair) {
    return &pair->run[1u - pair->sense];
}

/* ---- flags and sentences of an answer ---- */

static double checkpoint_s(unsigned k) {
    return 1e-6 * (double)GC_CHECKPOINT_US(k);
}

static double temp_c(const gc_pair_t *pair, unsigned k) {
    const gc_run_t *a = &pair->run[GC_SENSE_POSITIVE];
    const gc_run_t *b = &pair->run[GC_SENSE_NEGATIVE];
    return gc_sensor_temp_c(a->part, a->temp_at[k] + b->temp_at[k], a->n_at[k] + b->n_at[k]);
}

/* Blocks of both runs until checkpoint k. */
static double blocks(unsigned k) {
    return 2.0 * (double)GC_CHECKPOINT_US(k) / GC_BLOCK_US;
}

/* The answer is from the first n samples of the run in progress. The best correction is the latest, by the richest method. */
static void give(gc_pair_t *pair, gc_method_t method, unsigned k, uint32_t n, const gc_answer_t *answer, uint32_t flags) {
    const gc_run_t *run = &pair->run[pair->sense];
    const gc_port_t *port = pair->teller->port;
    gc_due_t *due = &pair->due;
    const gc_kept_answer_t kept = {
        .t_us = port->now_us(port->context),
        .first = run->first,
        .last = run->first + n - 1u,
        .seconds = checkpoint_s(k),
        .temp_c = temp_c(pair, k),
        .answer = *answer,
        .method = (int32_t)method,
        .axis = run->settings.axis,
        .flags = flags | pair->flags_at[0][k] | pair->flags_at[1][k] | gc_judge_answer(answer, blocks(k)),
    };
    gc_kept_add(pair->kept, pair->teller, &kept);
    const bool corrects = method != GC_METHOD_CNN || pair->net.corrects;
    const bool later = kept.seconds > due->best.seconds;
    if (corrects && (later || (kept.seconds == due->best.seconds && kept.method >= due->best.method))) {
        due->best = kept;
        due->answered = true;
    }
}

/* A misfit is reported at the last checkpoint, where most data are available. */
static void judge(gc_pair_t *pair, double misfit, unsigned k) {
    pair->verdict->misfit = misfit;
    if (k + 1u == GC_CHECKPOINTS && !(misfit <= GC_MISFIT_LIMIT(blocks(k)))) {
        gc_tell_error(pair->teller, GC_E_MISFIT);
    }
}

static void judge_face(gc_pair_t *pair) {
    if (!pair->due.face_told && gc_run_face_is_wrong(&pair->run[pair->sense])) {
        pair->due.face_told = true;
        gc_tell_error(pair->teller, GC_E_FACE);
    }
}

static void judge_direction(gc_pair_t *pair) {
    gc_run_t *run = &pair->run[pair->sense];
    if (!run->opposed && gc_run_is_opposed(run)) {
        run->opposed = true;
        gc_tell_error(pair->teller, GC_E_DIRECTION);
    }
}

/* ---- network ---- */

/* A sample is missing among the run's first n. */
static bool is_broken(const gc_pair_t *pair, unsigned sense, uint32_t n) {
    return pair->run[sense].missed > 0u && pair->kept->windows.run[sense].n < n;
}

static int solve_baseline(const gc_pair_t *pair, unsigned k, gc_answer_t *answer) {
    const gc_run_t *a = &pair->run[GC_SENSE_POSITIVE];
    const gc_run_t *b = &pair->run[GC_SENSE_NEGATIVE];
    return gc_baseline_solve(&a->baseline.at[k], &b->baseline.at[k], a->w_dps, b->w_dps, a->lsb_dps, answer);
}

/* Computes the next part of the network's answer at checkpoint k. *done: samples of each run that are in it, 0 = none yet. */
static int ask_net(gc_pair_t *pair, unsigned k, bool *done, uint32_t *n) {
    const gc_net_t *net = &pair->net;
    const gc_run_t *run = pair->run;
    int error = GC_OK;
    *done = false;
    if (fabs(net->rate_hz - run[pair->sense].settings.rate_hz) > 1e-3 * net->rate_hz) {
        return GC_E_NET_SAMPLE_RATE;
    }
    error = net->check(net);
    if (error != GC_OK) {
        return error;
    }
    *n = net->samples(net, k);
    if (*n == 0u) {
        *done = true;
        return GC_OK;
    }
    if (*n > GC_MAX_CNN_SAMPLES) {
        return GC_E_NET_WINDOW;
    }
    if (is_broken(pair, GC_SENSE_POSITIVE, *n) || is_broken(pair, GC_SENSE_NEGATIVE, *n)) {
        return GC_E_NET_GAP;
    }
    if (run[GC_SENSE_POSITIVE].n < *n || run[GC_SENSE_NEGATIVE].n < *n) {
        return GC_OK;
    }
    gc_net_run_t runs[GC_SENSES];
    for (unsigned i = 0; i < GC_SENSES; i++) {
        runs[i] = (gc_net_run_t){pair->kept->windows.run[i].counts, run[i].lsb_dps, run[i].w_dps};
    }
    const gc_calibration_t *known = pair->calibration;
    const bool of_axis = known != NULL && known->axis == *gc_axis_name(run[pair->sense].settings.axis);
    gc_net_answer_t found;
    error = net->go_on(net, &pair->due.net_work, runs, of_axis ? known : NULL, k, done, &found);
    if (error == GC_E_NET_RANGE) { /* only this stage has no answer */
        *done = true;
        if (!pair->due.range_told) {
            pair->due.range_told = true;
            gc_tell_error(pair->teller, error);
        }
        return GC_OK;
    }
    if (error != GC_OK || !*done) {
        return error;
    }
    gc_answer_t answer = {found.scale, found.scale_se, found.bias_dps, found.bias_se_dps, NAN};
    const bool known_table = of_axis && gc_estimator_knows_sensor(known); /* the network was trained for such a table */
    const uint32_t flags = gc_evidence_judge(&pair->due.evidence, known_table, &answer);
    give(pair, GC_METHOD_CNN, k, *n, &answer, flags);
    return GC_OK;
}

/* The network's answer that is due: that at the checkpoint of the latest evidence, if both runs have its samples. */
static void answer_by_net(gc_pair_t *pair, bool to_the_end) {
    gc_due_t *due = &pair->due;
    const gc_run_t *run = pair->run;
    if (pair->net.name == NULL || due->net_off || !due->paired || run[pair->sense].opposed) {
        return;
    }
    while (!due->weighing && due->net_next < due->evidences) {
        bool done;
        uint32_t n = 0;
        const int error = ask_net(pair, due->net_next, &done, &n);
        if (error != GC_OK) {
            gc_tell_error(pair->teller, error);
            due->net_off = true;
            return;
        }
        if (done) {
            due->net_next++;
        } else if (!to_the_end || run[0].n < n || run[1].n < n) {
            return;
        }
    }
}

/* ---- model ---- */

/* Computes the next part of the answer in progress, or all remaining parts. */
static void go_on_with_model(gc_pair_t *pair, bool to_the_end) {
    gc_due_t *due = &pair->due;
    bool done = false;
    int error = GC_OK;
    gc_answer_t answer;
    if (!due->solving) {
        return;
    }
    do {
        error = gc_estimator_go_on(&due->solution, &done, &answer);
    } while (error == GC_OK && !done && to_the_end);
    due->solving = error == GC_OK && !done;
    if (error != GC_OK) {
        gc_tell_error(pair->teller, error);
        due->model_error = error;
    } else if (done) {
        give(pair, GC_METHOD_MODEL, due->solved, pair->run[pair->sense].n_at[due->solved], &answer, 0);
        judge(pair, answer.misfit, due->solved);
    }
}

static void answer_by_model(gc_pair_t *pair, unsigned k) {
    gc_due_t *due = &pair->due;
    const gc_run_t *run = &pair->run[pair->sense];
    gc_marginal_t marginal;
    gc_estimator_marginal(&pair->estimator, &marginal);
    if (!due->paired) {
        pair->first_run[k] = marginal;
        return;
    }
    if (due->model_error != GC_OK || run->opposed || partner(pair)->baseline.checkpoints <= k) {
        return;
    }
    int error = GC_E_CALIBRATION_AXIS;
    if (pair->calibration->axis == *gc_axis_name(run->settings.axis)) {
        error = gc_estimator_begin_solve(&due->solution, pair->calibration, &pair->first_run[k], &marginal);
    }
    if (error != GC_OK) {
        gc_tell_error(pair->teller, error);
        due->model_error = error;
        return;
    }
    due->solving = true;
    due->solved = k;
    if (pair->calibration->n_alternatives == 0u) { /* one short part */
        go_on_with_model(pair, true);
    }
}

static void add_to_estimator(gc_pair_t *pair, const gc_taken_t *sample) {
    const gc_run_t *run = &pair->run[pair->sense];
    const uint64_t since_us = sample->t_us - run->first_us;
    const double t_s = 1e-6 * (double)since_us;
    gc_effect_input_t in = {
        .t_s = (float)t_s,
        .rate_dps = (float)run->w_dps,
        .theta_turn = (float)(run->settings.table_dps * t_s / 360.0),
        .temp_c = (float)(run->part->zero_c + run->part->lsb_c * sample->raw.temp),
        .power_on_s = (float)(1e-6 * (double)sample->t_us),
    };
    for (size_t i = 0; i < 3u; i++) {
        in.acc_g[i] = (float)(run->lsb_g * sample->raw.acc[i]);
    }
    const double measured_dps = run->lsb_dps * sample->raw.gyro[run->settings.axis];
    gc_estimator_add_sample(&pair->estimator, since_us / GC_BLOCK_US, measured_dps, run->w_dps, &in);
}

/* ---- baseline ---- */

/* Computes the next part of the standard errors of the answer in progress, or all remaining parts. */
static void go_on_with_baseline(gc_pair_t *pair, bool to_the_end) {
    gc_due_t *due = &pair->due;
    bool done = false;
    if (!due->weighing) {
        return;
    }
    do {
        done = gc_evidence_go_on(&due->evidence);
    } while (!done && to_the_end);
    due->weighing = !done;
    gc_answer_t answer;
    if (!done || solve_baseline(pair, due->weighed, &answer) != GC_OK) {
        return;
    }
    gc_evidence_errors(&due->evidence, &answer);
    give(pair, GC_METHOD_BASELINE, due->weighed, pair->run[pair->sense].n_at[due->weighed], &answer, 0);
    if (!pair->model || due->model_error != GC_OK) { /* the richer method judges */
        judge(pair, answer.misfit, due->weighed);
    }
}

static void answer_by_baseline(gc_pair_t *pair, unsigned k) {
    const gc_run_t *a = &pair->run[GC_SENSE_POSITIVE];
    const gc_run_t *b = &pair->run[GC_SENSE_NEGATIVE];
    gc_due_t *due = &pair->due;
    if (!due->paired || pair->run[pair->sense].opposed || partner(pair)->baseline.checkpoints <= k) {
        return;
    }
    due->net_next = k; /* an earlier checkpoint with missing samples is skipped */
    const unsigned seen = (unsigned)(GC_CHECKPOINT_US(k) / GC_BLOCK_US);
    const int error = gc_evidence_begin(&due->evidence, &a->seconds, &b->seconds, seen, a->w_dps, b->w_dps, a->lsb_dps);
    if (error != GC_OK) {
        gc_tell_error(pair->teller, error);
        due->net_off = true;
        return;
    }
    due->weighing = true;
    due->weighed = k;
    due->evidences = k + 1u;
}

/* ---- runs ---- */

/* Missing samples may lie before the checkpoint although the sample that reveals them lies behind it. */
static uint32_t gap_flag(const gc_run_t *run, unsigned k) {
    const uint64_t seen_us = run->last_us - run->first_us;
    const uint64_t due_us = GC_CHECKPOINT_US(k);
    const bool gap = due_us > seen_us && 1e-6 * ((double)(due_us - seen_us) * run->settings.rate_hz) > GC_GAP_PERIODS;
    return gap ? GC_FLAG_MISSED : 0u;
}

/* Answers at the checkpoints completed since `before`, or computes the next part of a deferred answer. */
static void answer_what_is_due(gc_pair_t *pair, unsigned before) {
    const unsigned reached = pair->run[pair->sense].baseline.checkpoints;
    for (unsigned k = before; k < reached; k++) {
        go_on_with_baseline(pair, true);
        go_on_with_model(pair, true);
        answer_by_net(pair, true); /* it is judged by the evidence of its own checkpoint */
        judge_direction(pair);
        pair->flags_at[pair->sense][k] = gc_judge_run(&pair->run[pair->sense]) | gap_flag(&pair->run[pair->sense], k);
        answer_by_baseline(pair, k);
        if (pair->model) {
            answer_by_model(pair, k);
        }
    }
    if (before < reached) {
        return;
    }
    if (pair->due.weighing) {
        go_on_with_baseline(pair, false);
    } else if (pair->due.solving) {
        go_on_with_model(pair, false);
    } else {
        answer_by_net(pair, false);
    }
}

/* Returns whether a run at w_dps would be the second one of a pair. */
static bool fits(const gc_run_t *half, const gc_settings_t *settings, const gc_sensor_t *sensor, double w_dps) {
    return fabs(half->w_dps + w_dps) <= SAME_RATE * fabs(w_dps) && half->settings.axis == settings->axis &&
           half->settings.rate_hz == settings->rate_hz && half->lsb_dps == sensor->lsb_dps;
}

gc_run_t *gc_pair_begin(gc_pair_t *pair, const gc_settings_t *settings, const gc_sensor_t *sensor, int face, bool automatic,
                        uint64_t first) {
    const double w_dps = gc_run_true_rate_dps(settings, face);
    pair->sense = w_dps > 0.0 ? GC_SENSE_POSITIVE : GC_SENSE_NEGATIVE;
    gc_run_t *run = &pair->run[pair->sense];
    gc_run_t *other = &pair->run[1u - pair->sense];
    memset(&pair->due, 0, sizeof pair->due);
    const bool half = other->complete && !run->complete;
    pair->due.paired = half && fits(other, settings, sensor, w_dps);
    if (half && !pair->due.paired) {
        gc_tell_error(pair->teller, GC_E_NO_PAIR);
    }
    other->complete = pair->due.paired;
    *pair->verdict = (gc_verdict_t){.misfit = NAN};
    gc_window_t *window = gc_kept_begin_window(pair->kept, pair->sense);
    window->rate_hz = settings->rate_hz;
    window->lsb_dps = sensor->lsb_dps;
    window->w_dps = w_dps;
    window->face = face;
    window->axis = settings->axis;
    if (pair->model) {
        gc_estimator_begin_run(&pair->estimator, pair->calibration, settings->rate_hz);
    }
    gc_run_begin(run, settings, sensor, face, automatic, first);
    return run;
}

bool gc_pair_add(gc_pair_t *pair, const gc_taken_t *sample) {
    gc_run_t *run = &pair->run[pair->sense];
    gc_window_t *window = &pair->kept->windows.run[pair->sense];
    const unsigned before = run->baseline.checkpoints;
    gc_run_advance(run, sample->t_us);
    answer_what_is_due(pair, before);
    const bool clips = gc_run_add(run, sample);
    if (run->n == (uint32_t)(FACE_S * run->settings.rate_hz) + 1u) {
        judge_face(pair);
    }
    if (window->n < GC_MAX_CNN_SAMPLES && run->missed == 0u) {
        window->counts[window->n++] = sample->raw.gyro[run->settings.axis];
    }
    if (pair->model && run->baseline.checkpoints < GC_CHECKPOINTS) {
        add_to_estimator(pair, sample);
    }
    return clips;
}

/* Automatic runs were compared with the table's rate when they began. */
static bool is_off_the_table(const gc_pair_t *pair, const gc_run_t *run) {
    const gc_kept_answer_t *best = &pair->due.best;
    return pair->due.answered && !run->automatic && (best->flags & ~(uint32_t)GC_FLAG_IMPLAUSIBLE) == 0u &&
           fabs(best->answer.scale) > GC_TABLE_RATE_FRACTION;
}

void gc_pair_end(gc_pair_t *pair) {
    gc_run_t *run = &pair->run[pair->sense];
    const unsigned before = run->baseline.checkpoints;
    gc_run_end(run);
    answer_what_is_due(pair, before);
    go_on_with_baseline(pair, true); /* what was put off */
    go_on_with_model(pair, true);
    answer_by_net(pair, true);
    gc_run_tell_faults(run, pair->teller);
    judge_direction(pair);
    judge_face(pair);
    run->complete = run->baseline.checkpoints > 0u && !run->opposed;
    if (run->baseline.checkpoints == 0u && !run->opposed) {
        gc_tell_error(pair->teller, GC_E_TOO_SHORT);
    }
    if (is_off_the_table(pair, run)) {
        gc_tell_error(pair->teller, GC_E_TABLE_RATE);
    }
    if (pair->due.answered && run->complete) {
        pair->verdict->trusted = pair->due.best.flags == 0u;
        gc_kept_correct_by(pair->kept, &pair->due.best);
    }
}

unsigned gc_pair_halves(const gc_pair_t *pair) {
    return (pair->run[0].complete ? 1u : 0u) + (pair->run[1].complete ? 1u : 0u);
}

void gc_pair_forget(gc_pair_t *pair) {
    pair->run[0].complete = false;
    pair->run[1].complete = false;
}
