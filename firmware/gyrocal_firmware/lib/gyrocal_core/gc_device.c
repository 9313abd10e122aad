#include "gc_device.h"

#include "gc_error.h"
#include "gc_format.h"

#include <math.h>
#include <string.h>

#define RETRY_US 1000000u     /* between attempts to set the sensor up */
#define GIVE_UP_US 500000u    /* without a good sample: set it up again */
#define IDLE_SLICE_US 20000u  /* commands are looked for so often while there is no sensor */
#define READY_POLL_US 100u
#define STEADY_US 200000u
#define STEADY_FRACTION 0.03
#define GRAVITY_MIN_G 0.5
#define ONE_G_TOLERANCE 0.2
#define STUCK_BITS 4u
#define STUCK_CHANGES 64u
#define DUMP_LINES_A_STEP 4u
#define FIFO_LONGEST_S 0.25 /* of a batch: commands are heard between two */

static const char *const axis_names[] = {"x", "y", "z"};
static const char *const state_names[] = {"idle", "recording", "flip", "done"};

static const char *face_name(int face) {
    return face > 0 ? "up" : "down";
}

static uint64_t now_us(const gc_device_t *d) {
    return d->config.port->now_us(d->config.port->context);
}

/* ---- sentences ---- */

static gc_sentence_t *begin(gc_device_t *d, const char tag[3], uint64_t t_us) {
    gc_sentence_begin(&d->sentence, tag, d->seq++, t_us, d->config.imu);
    return &d->sentence;
}

static void finish(gc_device_t *d) {
    const int n = gc_sentence_end(&d->sentence);
    if (n < 0 || d->config.port->send(d->config.port->context, d->sentence.text, (size_t)n) != n) {
        d->lost++;
    }
}

static void tell_error(gc_device_t *d, int code) {
    gc_sentence_t *s = begin(d, "ERR", now_us(d));
    gc_sentence_int(s, "code", code);
    gc_sentence_text(s, "name", gc_error_name(code));
    gc_sentence_text(s, "advice", gc_error_advice(code));
    finish(d);
}

static void tell_ack(gc_device_t *d, const char *command) {
    gc_sentence_text(begin(d, "ACK", now_us(d)), "cmd", command);
    finish(d);
}

static const char *net_name(const gc_cnn_net_t *net) {
    return net == NULL ? NULL : net->convnet != NULL ? net->convnet->name : net->name;
}

static void tell_hello(gc_device_t *d) {
    gc_sentence_t *s = begin(d, "HEL", now_us(d));
    gc_sentence_uint(s, "proto", GC_WIRE_PROTOCOL);
    gc_sentence_text(s, "fw", GC_FIRMWARE_VERSION);
    gc_sentence_text(s, "sensor", "LSM6DSO");
    gc_sentence_real(s, "rate_hz", d->settings.rate_hz);
    gc_sentence_real(s, "odr_hz", d->sensor.odr_hz);
    gc_sentence_real(s, "full_scale_dps", d->settings.full_scale_dps);
    gc_sentence_real(s, "lsb_dps", d->sensor.lsb_dps);
    gc_sentence_real(s, "lsb_g", GC_LSM6DSO_LSB_G);
    gc_sentence_real(s, "lsb_c", GC_LSM6DSO_LSB_C);
    gc_sentence_real(s, "zero_c", GC_LSM6DSO_ZERO_C);
    gc_sentence_text(s, "axis", axis_names[d->settings.axis]);
    gc_sentence_real(s, "table_dps", d->settings.table_dps);
    gc_sentence_real(s, "turn_deg", d->settings.turn_deg);
    gc_sentence_text(s, "cal", d->config.calibration != NULL ? d->config.calibration->name : NULL);
    gc_sentence_text(s, "net", net_name(d->config.net));
    finish(d);
}

static void tell_status(gc_device_t *d) {
    gc_sentence_t *s = begin(d, "STA", now_us(d));
    gc_sentence_text(s, "state", state_names[gc_device_state(d)]);
    gc_sentence_text(s, "face", d->recording ? face_name(d->run[d->slot].face) : NULL);
    gc_sentence_uint(s, "n", d->recording ? d->run[d->slot].n : 0u);
    gc_sentence_uint(s, "lost", d->lost);
    gc_sentence_uint(s, "stale", d->stale);
    gc_sentence_uint(s, "resets", d->resets);
    gc_sentence_uint(s, "missed", d->missed);
    gc_sentence_uint(s, "overruns", d->overruns);
    gc_sentence_real(s, "misfit", d->misfit);
    finish(d);
}

static double temp_c(int64_t sum, uint32_t n) {
    return n == 0u ? NAN : GC_LSM6DSO_ZERO_C + GC_LSM6DSO_LSB_C * (double)sum / (double)n;
}

static void tell_run(gc_device_t *d, const gc_run_t *run, bool ended) {
    gc_sentence_t *s = begin(d, "RUN", now_us(d));
    gc_sentence_text(s, "state", ended ? "end" : "start");
    gc_sentence_text(s, "face", face_name(run->face));
    gc_sentence_text(s, "axis", axis_names[run->settings.axis]);
    gc_sentence_real(s, "table_dps", run->settings.table_dps);
    gc_sentence_real(s, "turn_deg", run->settings.turn_deg);
    gc_sentence_uint(s, "n", run->n);
    gc_sentence_uint(s, "first", run->first);
    if (run->n > 0u) {
        gc_sentence_uint(s, "last", d->samples - 1u);
    } else {
        gc_sentence_text(s, "last", NULL);
    }
    if (ended) {
        static const char *const names[] = {"mean_x_dps", "mean_y_dps", "mean_z_dps"};
        for (size_t i = 0; i < 3u; i++) {
            gc_sentence_real(s, names[i], run->n == 0u ? NAN : run->lsb_dps * (double)run->sum[i] / (double)run->n);
        }
        gc_sentence_real(s, "duration_s", run->n == 0u ? NAN : 1e-6 * (double)(run->last_us - run->first_us));
        gc_sentence_real(s, "temp_c", temp_c(run->temp_sum, run->n));
        gc_sentence_uint(s, "clipped", run->clipped);
        gc_sentence_uint(s, "missed", run->missed);
    }
    finish(d);
}

/* Over the first n samples of the run in progress. */
static void tell_answer(gc_device_t *d, gc_method_t method, double seconds, uint32_t n, double temperature_c,
                        const gc_answer_t *answer) {
    const gc_run_t *run = &d->run[d->slot];
    const gc_kept_answer_t kept = {
        .t_us = now_us(d),
        .first = run->first,
        .last = run->first + n - 1u,
        .seconds = seconds,
        .temp_c = temperature_c,
        .answer = *answer,
        .method = (int32_t)method,
        .axis = run->settings.axis,
    };
    gc_kept_answer_fields(begin(d, "CAL", kept.t_us), &kept);
    finish(d);
    gc_results_add(&d->results, &kept, d->first_answer);
    d->first_answer = false;
    d->results_changed = true;
}

static void tell_raw(gc_device_t *d, uint64_t t_us, const gc_sample_t *sample) {
    gc_sentence_t *s = begin(d, "RAW", t_us);
    gc_sentence_int(s, NULL, d->recording ? (int64_t)d->run[d->slot].n : -1);
    for (size_t i = 0; i < 3u; i++) {
        gc_sentence_int(s, NULL, sample->gyro[i]);
    }
    for (size_t i = 0; i < 3u; i++) {
        gc_sentence_int(s, NULL, sample->acc[i]);
    }
    gc_sentence_int(s, NULL, sample->temp);
    finish(d);
}

static void tell_corrected(gc_device_t *d, uint64_t t_us, const gc_sample_t *sample) {
    gc_sentence_t *s = begin(d, "GYR", t_us);
    gc_sentence_int(s, NULL, d->recording ? (int64_t)d->run[d->slot].n : -1);
    for (unsigned i = 0; i < 3u; i++) {
        gc_sentence_real(s, NULL, gc_results_correct(&d->results, i, d->sensor.lsb_dps * sample->gyro[i]));
    }
    finish(d);
}

static void tell_teleplot(gc_device_t *d, const gc_sample_t *sample) {
    char text[3 * (6 + GC_FORMAT_MAX)];
    size_t n = 0;
    for (size_t i = 0; i < 3u; i++) {
        text[n++] = '>';
        text[n++] = 'g';
        text[n++] = axis_names[i][0];
        text[n++] = ':';
        n += gc_format_real(d->sensor.lsb_dps * sample->gyro[i], text + n);
        text[n++] = '\n';
    }
    (void)d->config.port->send(d->config.port->context, text, n);
}

/* ---- state ---- */

gc_state_t gc_device_state(const gc_device_t *d) {
    if (d->recording) {
        return GC_STATE_RECORDING;
    }
    const bool positive = d->run[GC_SLOT_POSITIVE].complete;
    const bool negative = d->run[GC_SLOT_NEGATIVE].complete;
    if (positive && negative) {
        return GC_STATE_DONE;
    }
    return positive || negative ? GC_STATE_FLIP : GC_STATE_IDLE;
}

static void show_led(gc_device_t *d) {
    static const gc_led_t of_state[] = {GC_LED_IDLE, GC_LED_RECORDING, GC_LED_FLIP, GC_LED_DONE};
    gc_led_t led = of_state[gc_device_state(d)];
    if (led == GC_LED_DONE && d->misfits) {
        led = GC_LED_MISFIT;
    }
    if (d->config.port->led != NULL && (!d->led_known || led != d->led)) {
        d->config.port->led(d->config.port->context, led);
    }
    d->led = led;
    d->led_known = true;
}

static void set_up_sensor(gc_device_t *d) {
    const double odr_hz = gc_lsm6dso_odr_for(d->settings.rate_hz);
    int error = gc_lsm6dso_init(&d->sensor, d->config.port, d->config.address, odr_hz, d->settings.full_scale_dps);
    if (error == GC_OK && d->settings.fifo > 0.0) {
        error = gc_lsm6dso_fifo_begin(&d->sensor, (unsigned)d->settings.fifo);
    }
    const uint64_t now = now_us(d);
    d->sensor_ready = error == GC_OK;
    d->sensor_error = GC_OK;
    d->good_us = now;
    d->epoch_us = now;
    d->tick = 0;
    d->fifo_known = false;
    d->retry_us = now + RETRY_US;
    if (error != GC_OK) {
        tell_error(d, error);
    }
}

/* What survives power-off. */
#define SETTINGS_VERSION 3u
#define RESULTS_VERSION 2u /* the answers of another network or of another meaning are not recalled */
#define WINDOWS_VERSION 1u

/* Written between runs only: a write to flash takes longer than a sample may wait. */
static void keep_results(gc_device_t *d) {
    const gc_port_t *port = d->config.port;
    int error = GC_OK;
    if (port->store != NULL && d->results_changed) {
        error = gc_store_save(port, "results", RESULTS_VERSION, &d->results.record, sizeof d->results);
    }
    if (port->store != NULL && d->windows_changed && error == GC_OK) {
        error = gc_store_save(port, "windows", WINDOWS_VERSION, &d->windows.record, sizeof d->windows);
    }
    d->results_changed = false;
    d->windows_changed = false;
    if (error != GC_OK) {
        tell_error(d, error);
    }
}

static void recall_results(gc_device_t *d) {
    const gc_port_t *port = d->config.port;
    (void)gc_store_load(port, "results", RESULTS_VERSION, &d->results.record, sizeof d->results);
    (void)gc_store_load(port, "windows", WINDOWS_VERSION, &d->windows.record, sizeof d->windows);
}

static void forget_results(gc_device_t *d) {
    const gc_record_t results = d->results.record;
    const gc_record_t windows = d->windows.record;
    memset(&d->results, 0, sizeof d->results);
    memset(&d->windows, 0, sizeof d->windows);
    d->results.record = results;
    d->windows.record = windows;
    d->results_changed = true;
    d->windows_changed = true;
    keep_results(d);
}

static void forget_runs(gc_device_t *d) {
    for (size_t i = 0; i < GC_SLOTS; i++) {
        d->run[i].complete = false;
    }
    d->misfit = NAN;
    d->misfits = false;
}

/* ---- answers ---- */

static double pair_temp_c(const gc_device_t *d, unsigned k) {
    const gc_run_t *a = &d->run[GC_SLOT_POSITIVE];
    const gc_run_t *b = &d->run[GC_SLOT_NEGATIVE];
    return temp_c(a->temp_at[k] + b->temp_at[k], a->n_at[k] + b->n_at[k]);
}

static double checkpoint_s(unsigned k) {
    return 1e-6 * (double)GC_CHECKPOINT_US(k);
}

static int solve_baseline(const gc_device_t *d, unsigned k, gc_answer_t *answer) {
    const gc_run_t *a = &d->run[GC_SLOT_POSITIVE];
    const gc_run_t *b = &d->run[GC_SLOT_NEGATIVE];
    return gc_baseline_solve(&a->baseline.at[k], &b->baseline.at[k], a->w_dps, b->w_dps, a->lsb_dps, answer);
}

/* Do two runs' readings fit what is known of sensor and table? Told at the last checkpoint, when most can be seen. */
static void judge(gc_device_t *d, double misfit, unsigned k) {
    d->misfit = misfit;
    d->misfits = misfit > GC_MISFIT_LIMIT(2.0 * (double)(GC_CHECKPOINT_US(k) / GC_BLOCK_US));
    if (d->misfits && k + 1u == GC_CHECKPOINTS) {
        tell_error(d, GC_E_MISFIT);
    }
}

static int check_net(const gc_device_t *d) {
    const gc_cnn_net_t *net = d->config.net;
    const double rate_hz = (double)(net->convnet != NULL ? net->convnet->rate_hz : net->rate_hz);
    if (fabs(rate_hz - d->run[d->slot].settings.rate_hz) > 1e-3 * rate_hz) {
        return GC_E_NET_SAMPLE_RATE;
    }
    if (net->convnet != NULL) {
        return gc_convnet_samples(net->convnet, GC_CHECKPOINTS - 1u) <= GC_MAX_CNN_SAMPLES ? GC_OK : GC_E_NET_WINDOW;
    }
    if (net->window == 0u || net->window > GC_MAX_CNN_WINDOW || net->outputs != 2u) {
        return GC_E_NET_WINDOW;
    }
    return net->scratch_floats <= GC_MAX_CNN_SCRATCH ? GC_OK : GC_E_NET_MEMORY;
}

static void residuals(const gc_run_t *run, const int16_t *counts, uint32_t n, float *out) {
    const float lsb_dps = (float)run->lsb_dps;
    const float w_dps = (float)run->w_dps;
    for (uint32_t i = 0; i < n; i++) {
        out[i] = (float)counts[i] * lsb_dps - w_dps;
    }
}

static int run_next_window(gc_device_t *d) {
    const gc_run_t *up = &d->run[GC_SLOT_POSITIVE];
    const gc_run_t *down = &d->run[GC_SLOT_NEGATIVE];
    const uint32_t window = d->config.net->window;
    const uint32_t from = d->cnn_windows * window;
    residuals(up, d->windows.run[GC_SLOT_POSITIVE].counts + from, window, d->cnn_up);
    residuals(down, d->windows.run[GC_SLOT_NEGATIVE].counts + from, window, d->cnn_down);
    float out[2];
    const int error = gc_cnn_run(d->config.net, d->cnn_up, d->cnn_down, (float)up->w_dps, (float)down->w_dps,
                                 d->cnn_scratch, out);
    if (error == GC_OK) {
        d->cnn_sum[0] += (double)out[0];
        d->cnn_sum[1] += (double)out[1];
        d->cnn_windows++;
    }
    return error;
}

/* A sample is missing among the run's first n. */
static bool is_broken(const gc_device_t *d, unsigned slot, uint32_t n) {
    return d->run[slot].missed > 0u && d->windows.run[slot].n < n;
}

/* Samples of each run that the network takes for checkpoint k: whole windows, or those of a stage. */
static uint32_t cnn_samples(const gc_cnn_net_t *net, unsigned k) {
    if (net->convnet != NULL) {
        return gc_convnet_samples(net->convnet, k);
    }
    return net->window * (uint32_t)floor(checkpoint_s(k) * (double)net->rate_hz / (double)net->window + 1e-6);
}

/* The paper's network: the mean of its answers over the windows; it gives no standard errors. */
static int run_windows(gc_device_t *d, uint32_t windows, gc_answer_t *answer) {
    while (d->cnn_windows < windows) {
        const int error = run_next_window(d);
        if (error != GC_OK) {
            return error;
        }
    }
    answer->scale = d->cnn_sum[0] / (double)windows;
    answer->bias_dps = d->cnn_sum[1] / (double)windows;
    answer->scale_se = NAN;
    answer->bias_se_dps = NAN;
    return GC_OK;
}

static int run_face(gc_device_t *d, unsigned k, unsigned slot, gc_convnet_face_t *face) {
    const gc_run_t *run = &d->run[slot];
    return gc_convnet_face(d->config.net->convnet, d->windows.run[slot].counts, k, run->lsb_dps, run->w_dps, face);
}

/* Network gyrocal's answer: one face, and the other with the next sample or at once. */
static int run_convnet(gc_device_t *d, unsigned k, bool to_the_end, bool *done, gc_answer_t *answer) {
    int error = GC_OK;
    if (!d->cnn_half) {
        error = run_face(d, k, GC_SLOT_POSITIVE, &d->cnn_face);
        d->cnn_half = error == GC_OK;
        if (error != GC_OK || !to_the_end) {
            *done = false;
            return error;
        }
    }
    d->cnn_half = false;
    gc_convnet_face_t other;
    error = run_face(d, k, GC_SLOT_NEGATIVE, &other);
    if (error == GC_OK) {
        const gc_calibration_t *calibration = d->config.calibration;
        const bool known = calibration != NULL && calibration->axis == axis_names[d->run[d->slot].settings.axis][0];
        gc_convnet_merge(known ? calibration : NULL, &d->cnn_face, &other, answer);
    }
    return error;
}

/* The network's answers that are due: those whose baseline is there and whose samples are there in both runs. */
static void answer_by_cnn(gc_device_t *d, bool to_the_end) {
    const gc_run_t *up = &d->run[GC_SLOT_POSITIVE];
    const gc_run_t *down = &d->run[GC_SLOT_NEGATIVE];
    const gc_cnn_net_t *net = d->config.net;
    if (net == NULL || d->cnn_off || !d->paired || d->run[d->slot].opposed) {
        return;
    }
    while (d->cnn_next < up->baseline.checkpoints && d->cnn_next < down->baseline.checkpoints) {
        const unsigned k = d->cnn_next;
        int error = check_net(d);
        if (error == GC_OK) {
            const uint32_t n = cnn_samples(net, k);
            if (n == 0u) {
                d->cnn_next++;
                continue;
            }
            gc_answer_t answer = {0};
            if (n > GC_MAX_CNN_SAMPLES) {
                error = GC_E_NET_WINDOW;
            } else if (is_broken(d, GC_SLOT_POSITIVE, n) || is_broken(d, GC_SLOT_NEGATIVE, n)) {
                error = GC_E_NET_GAP;
            } else if (up->n < n || down->n < n) {
                return;
            }
            if (error == GC_OK) {
                error = solve_baseline(d, k, &answer); /* its misfit is that of the data */
            }
            if (error == GC_OK) {
                bool done = true;
                error = net->convnet != NULL ? run_convnet(d, k, to_the_end, &done, &answer) : run_windows(d, n / net->window, &answer);
                if (error == GC_OK && !done) {
                    return;
                }
            }
            if (error == GC_OK) {
                tell_answer(d, GC_METHOD_CNN, checkpoint_s(k), n, pair_temp_c(d, k), &answer);
            }
            if (error == GC_E_NET_RANGE) { /* of this stage alone */
                if (!d->range_told) {
                    tell_error(d, error);
                    d->range_told = true;
                }
                error = GC_OK;
            }
            d->cnn_next += error == GC_OK ? 1u : 0u;
        }
        if (error != GC_OK) {
            tell_error(d, error);
            d->cnn_off = true;
            return;
        }
    }
}

/* The model's answer in progress: its next part, or all that is left. */
static void go_on_with_model(gc_device_t *d, bool to_the_end) {
    bool done = false;
    int error = GC_OK;
    gc_answer_t answer;
    if (!d->solving) {
        return;
    }
    do {
        error = gc_estimator_go_on(&d->solution, &done, &answer);
    } while (error == GC_OK && !done && to_the_end);
    d->solving = error == GC_OK && !done;
    if (error != GC_OK) {
        tell_error(d, error);
        d->model_error = error;
    } else if (done) {
        const unsigned k = d->solved;
        tell_answer(d, GC_METHOD_MODEL, checkpoint_s(k), d->run[d->slot].n_at[k], pair_temp_c(d, k), &answer);
        judge(d, answer.misfit, k);
    }
}

static void answer_by_model(gc_device_t *d, unsigned k) {
    gc_marginal_t marginal;
    gc_estimator_marginal(&d->estimator, &marginal);
    if (!d->paired) {
        d->first_run[k] = marginal;
        return;
    }
    if (d->model_error != GC_OK || d->run[d->slot].opposed || d->run[1u - d->slot].baseline.checkpoints <= k) {
        return;
    }
    const gc_calibration_t *calibration = d->config.calibration;
    int error = GC_OK;
    if (calibration->axis != axis_names[d->run[d->slot].settings.axis][0]) {
        error = GC_E_CALIBRATION_AXIS;
    } else {
        error = gc_estimator_begin_solve(&d->solution, calibration, &d->first_run[k], &marginal);
    }
    if (error != GC_OK) {
        tell_error(d, error);
        d->model_error = error;
        return;
    }
    d->solving = true;
    d->solved = k;
    if (calibration->n_alternatives == 0u) { /* one part, and soon done */
        go_on_with_model(d, true);
    }
}

static void answer_by_baseline(gc_device_t *d, unsigned k) {
    const gc_run_t *run = &d->run[d->slot];
    if (!d->paired || run->opposed || d->run[1u - d->slot].baseline.checkpoints <= k) {
        return;
    }
    gc_answer_t answer;
    const int error = solve_baseline(d, k, &answer);
    if (error == GC_OK) {
        tell_answer(d, GC_METHOD_BASELINE, checkpoint_s(k), run->n_at[k], pair_temp_c(d, k), &answer);
        if (!d->model || d->model_error != GC_OK) { /* the richer method judges */
            judge(d, answer.misfit, k);
        }
    } else {
        tell_error(d, error);
    }
}

static void judge_direction(gc_device_t *d, gc_run_t *run) {
    if (!run->opposed && (double)run->sum[run->settings.axis] * run->w_dps < 0.0) {
        run->opposed = true;
        tell_error(d, GC_E_DIRECTION);
    }
}

/* Answers at the checkpoints completed since `before`. What takes long comes in the samples after them: the model's where there
   are alternatives, a part a sample, then the network's, a face a sample. */
static void answer(gc_device_t *d, unsigned before) {
    gc_run_t *run = &d->run[d->slot];
    for (unsigned k = before; k < run->baseline.checkpoints; k++) {
        run->n_at[k] = run->n;
        run->temp_at[k] = run->temp_sum;
        if (d->slot != GC_SLOT_OTHER) {
            go_on_with_model(d, true);
            judge_direction(d, run);
            answer_by_baseline(d, k);
            if (d->model) {
                answer_by_model(d, k);
            }
        }
    }
    if (d->slot == GC_SLOT_OTHER || before < run->baseline.checkpoints) {
        return;
    }
    if (d->solving) {
        go_on_with_model(d, false);
    } else {
        answer_by_cnn(d, false);
    }
}

/* ---- runs ---- */

static void start_run(gc_device_t *d, int face, bool automatic) {
    const gc_settings_t *settings = &d->settings;
    const double w_dps = settings->turn_deg != 0.0 ? NAN : settings->table_dps * face;
    d->dump_lines = 0; /* its windows are about to be overwritten */
    d->slot = w_dps > 0.0 ? GC_SLOT_POSITIVE : w_dps < 0.0 ? GC_SLOT_NEGATIVE : GC_SLOT_OTHER;
    d->paired = false;
    if (d->slot != GC_SLOT_OTHER) {
        gc_run_t *partner = &d->run[1u - d->slot];
        d->paired = partner->complete && !d->run[d->slot].complete && partner->w_dps == -w_dps &&
                    partner->settings.axis == settings->axis && partner->settings.rate_hz == settings->rate_hz &&
                    partner->lsb_dps == d->sensor.lsb_dps;
        partner->complete = d->paired;
        d->windows.run[d->slot] = (gc_window_t){
            .rate_hz = settings->rate_hz, .lsb_dps = d->sensor.lsb_dps, .w_dps = w_dps, .face = face, .axis = settings->axis};
        d->windows_changed = true;
        d->first_answer = true;
        d->misfit = NAN;
        d->misfits = false;
        d->model_error = GC_OK;
        d->solving = false;
        d->cnn_off = false;
        d->range_told = false;
        d->cnn_next = 0;
        d->cnn_half = false;
        d->cnn_windows = 0;
        d->cnn_sum[0] = 0.0;
        d->cnn_sum[1] = 0.0;
        if (d->model) {
            gc_estimator_begin_run(&d->estimator, d->config.calibration, settings->rate_hz);
        }
    }
    gc_run_t *run = &d->run[d->slot];
    memset(run, 0, sizeof *run);
    run->face = face;
    run->automatic = automatic;
    run->settings = *settings;
    run->lsb_dps = d->sensor.lsb_dps;
    run->w_dps = w_dps;
    run->first = d->samples;
    run->bits_and = 0xFFFFu;
    run->min = INT16_MAX;
    run->max = INT16_MIN;
    gc_baseline_begin(&run->baseline, settings->rate_hz);
    d->recording = true;
    tell_run(d, run, false);
}

static void add_to_estimator(gc_device_t *d, const gc_run_t *run, uint64_t t_us, const gc_sample_t *sample) {
    const double t_s = 1e-6 * (double)(t_us - run->first_us);
    gc_effect_input_t in = {
        .t_s = (float)t_s,
        .rate_dps = (float)run->w_dps,
        .theta_turn = (float)(run->settings.table_dps * t_s / 360.0),
        .temp_c = (float)(GC_LSM6DSO_ZERO_C + GC_LSM6DSO_LSB_C * sample->temp),
        .power_on_s = (float)(1e-6 * (double)t_us),
    };
    for (size_t i = 0; i < 3u; i++) {
        in.acc_g[i] = (float)(GC_LSM6DSO_LSB_G * sample->acc[i]);
    }
    gc_estimator_add_sample(&d->estimator, (t_us - run->first_us) / GC_BLOCK_US,
                            run->lsb_dps * sample->gyro[run->settings.axis], run->w_dps, &in);
}

static void watch_clipping(gc_device_t *d, gc_run_t *run, int16_t count) {
    const double limit = fmin(floor(d->sensor.full_scale_dps / run->lsb_dps), INT16_MAX);
    if (fabs((double)count) >= limit) {
        run->clipped++;
        if (!run->clip_told) {
            run->clip_told = true;
            tell_error(d, GC_E_CLIPPED);
        }
    }
}

static uint32_t missed_between(const gc_device_t *d, uint64_t before_us, uint64_t t_us) {
    const double periods = 1e-6 * ((double)(t_us - before_us) * d->settings.rate_hz);
    return periods > GC_GAP_PERIODS ? (uint32_t)(periods + 0.5) - 1u : 0u;
}

static void add_to_run(gc_device_t *d, uint64_t t_us, const gc_sample_t *sample) {
    gc_run_t *run = &d->run[d->slot];
    const int axis = run->settings.axis;
    const int16_t count = sample->gyro[axis];
    const unsigned before = run->baseline.checkpoints;
    gc_baseline_advance(&run->baseline, t_us);
    answer(d, before);

    if (run->n == 0u) {
        run->first = d->samples;
        run->first_us = t_us;
    } else {
        for (size_t i = 0; i < 3u; i++) {
            const int64_t diff = (int64_t)sample->gyro[i] - run->last[i];
            run->sum_sq_diff[i] += diff * diff;
        }
        run->turn += ((int64_t)run->last[axis] + count) * (int64_t)(t_us - run->last_us);
        run->changes += count != run->last[axis] ? 1u : 0u;
        run->missed += missed_between(d, run->last_us, t_us);
    }
    for (size_t i = 0; i < 3u; i++) {
        run->sum[i] += sample->gyro[i];
        run->acc_sum[i] += sample->acc[i];
        run->last[i] = sample->gyro[i];
    }
    run->temp_sum += sample->temp;
    run->bits_or |= (uint16_t)count;
    run->bits_and &= (uint16_t)count;
    run->min = count < run->min ? count : run->min;
    run->max = count > run->max ? count : run->max;
    run->last_us = t_us;
    gc_baseline_add(&run->baseline, t_us, count);
    if (d->slot != GC_SLOT_OTHER) {
        gc_window_t *window = &d->windows.run[d->slot];
        if (window->n < GC_MAX_CNN_SAMPLES && run->missed == 0u) {
            window->counts[window->n++] = count;
        }
        if (d->model && run->baseline.checkpoints < GC_CHECKPOINTS) {
            add_to_estimator(d, run, t_us, sample);
        }
    }
    run->n++;
    watch_clipping(d, run, count);
}

/* A low bit that never changes although the reading moves over several of its steps. */
static bool has_stuck_bit(const gc_run_t *run) {
    if (run->changes < STUCK_CHANGES) {
        return false;
    }
    for (unsigned bit = 0; bit < STUCK_BITS; bit++) {
        const unsigned mask = 1u << bit;
        const bool constant = (run->bits_or & mask) == 0u || (run->bits_and & mask) != 0u;
        if (constant && run->max - run->min >= (int)(4u * mask)) {
            return true;
        }
    }
    return false;
}

static void end_rest(gc_device_t *d, const gc_run_t *run) {
    gc_answer_t rest;
    const int error = gc_baseline_rest(&run->baseline.total, run->lsb_dps, &rest);
    if (error != GC_OK) {
        tell_error(d, error);
        return;
    }
    double acc_sq = 0.0;
    for (size_t i = 0; i < 3u; i++) {
        const double n = (double)run->n;
        const double variance = run->lsb_dps * run->lsb_dps * (double)run->sum_sq_diff[i] / (2.0 * (n - 1.0));
        const double acc_g = GC_LSM6DSO_LSB_G * (double)run->acc_sum[i] / n;
        d->rest[i].known = true;
        d->rest[i].bias_dps = run->lsb_dps * (double)run->sum[i] / n;
        d->rest[i].white_variance = variance;
        d->rest[i].bias_variance = variance / n;
        acc_sq += acc_g * acc_g;
    }
    if (fabs(sqrt(acc_sq) - 1.0) > ONE_G_TOLERANCE) {
        tell_error(d, GC_E_NOT_ONE_G);
    }
    d->misfit = rest.misfit;
    d->misfits = rest.misfit > GC_MISFIT_LIMIT((double)(run->last_us - run->first_us) / (double)GC_BLOCK_US);
    tell_answer(d, GC_METHOD_REST, 1e-6 * (double)(run->last_us - run->first_us), run->n, temp_c(run->temp_sum, run->n), &rest);
}

static void end_turn(gc_device_t *d, const gc_run_t *run) {
    const gc_rest_t *rest = &d->rest[run->settings.axis];
    if (!rest->known) {
        tell_error(d, GC_E_NO_REST);
        return;
    }
    if (run->n < 2u) {
        tell_error(d, GC_E_TOO_SHORT);
        return;
    }
    const double seconds = 1e-6 * (double)(run->last_us - run->first_us);
    const double true_deg = run->settings.turn_deg * run->face;
    const double measured_deg = run->lsb_dps * 0.5e-6 * (double)run->turn;
    const double period_s = seconds / (double)(run->n - 1u);
    gc_answer_t turn;
    turn.scale = (measured_deg - rest->bias_dps * seconds) / true_deg - 1.0;
    turn.scale_se = sqrt(rest->white_variance * period_s * seconds + rest->bias_variance * seconds * seconds) / fabs(true_deg);
    turn.bias_dps = rest->bias_dps;
    turn.bias_se_dps = sqrt(rest->bias_variance);
    turn.misfit = NAN;
    tell_answer(d, GC_METHOD_TURN, seconds, run->n, temp_c(run->temp_sum, run->n), &turn);
}

static void stop_run(gc_device_t *d) {
    gc_run_t *run = &d->run[d->slot];
    const unsigned before = run->baseline.checkpoints;
    gc_baseline_end(&run->baseline);
    answer(d, before);
    go_on_with_model(d, true); /* what was put off */
    answer_by_cnn(d, true);
    if (has_stuck_bit(run)) {
        tell_error(d, GC_E_STUCK_BIT);
    }
    if (d->slot != GC_SLOT_OTHER) {
        judge_direction(d, run);
        run->complete = run->baseline.checkpoints > 0u && !run->opposed;
        if (run->baseline.checkpoints == 0u && !run->opposed) {
            tell_error(d, GC_E_TOO_SHORT);
        }
    } else if (run->settings.turn_deg != 0.0) {
        end_turn(d, run);
    } else if (run->w_dps == 0.0) {
        end_rest(d, run);
    }
    d->recording = false;
    tell_run(d, run, true);
    keep_results(d);
}

/* Begins a run when face, direction and rate have been right for a while, and ends it when they no longer are. */
static void watch_table(gc_device_t *d, uint64_t t_us, const gc_sample_t *sample) {
    const int axis = d->settings.axis;
    const double acc_g = GC_LSM6DSO_LSB_G * sample->acc[axis];
    const int face = acc_g > GRAVITY_MIN_G ? 1 : acc_g < -GRAVITY_MIN_G ? -1 : 0;
    const double w_dps = d->settings.table_dps * face;
    const double off_dps = fabs(d->sensor.lsb_dps * sample->gyro[axis] - w_dps);
    const bool steady = fabs(w_dps) > 0.0 && off_dps <= STEADY_FRACTION * fabs(w_dps);
    if (steady != d->steady) {
        d->steady = steady;
        d->steady_since_us = t_us;
    }
    if (!d->settings.automatic || t_us - d->steady_since_us < STEADY_US) {
        return;
    }
    if (!steady) {
        d->armed = true;
        if (d->recording && d->run[d->slot].automatic) {
            stop_run(d);
        }
    } else if (d->armed && !d->recording) {
        d->armed = false;
        start_run(d, face, true);
    }
}

/* ---- samples ---- */

static void take_sample(gc_device_t *d, uint64_t t_us, const gc_sample_t *sample) {
    d->missed += d->sample_us > 0u ? missed_between(d, d->sample_us, t_us) : 0u;
    d->sample_us = t_us;
    if (d->stream == GC_STREAM_RAW) {
        tell_raw(d, t_us, sample);
    } else if (d->stream == GC_STREAM_CORRECTED) {
        tell_corrected(d, t_us, sample);
    } else if (d->stream == GC_STREAM_TELEPLOT) {
        tell_teleplot(d, sample);
    }
    if (d->recording) {
        add_to_run(d, t_us, sample);
    }
    d->samples++;
    watch_table(d, t_us, sample);
    show_led(d);
}

/* A reading that ended so: told once an episode, and the sensor set up again when it must be. */
static void judge_reading(gc_device_t *d, uint64_t t_us, int error) {
    if (error == GC_OK || error == GC_E_FIFO_OVERRUN) {
        d->good_us = t_us;
    }
    if (error != GC_OK && error != d->sensor_error) {
        tell_error(d, error);
    }
    d->sensor_error = error;
    d->stale += error == GC_E_STALE ? 1u : 0u;
    if (error == GC_E_CONFIG_LOST || t_us - d->good_us > GIVE_UP_US) {
        set_up_sensor(d);
        d->resets++;
    }
}

/* The newest sample was taken within a period before the reading; those since the newest of the last reading lie evenly. */
static void take_batch(gc_device_t *d) {
    const gc_lsm6dso_batch_t *batch = &d->batch;
    const double period_us = d->sensor.period_us;
    const double left_us = period_us * batch->left;
    const double earliest_us = (double)batch->t_us - period_us - left_us;
    const double latest_us = (double)batch->until_us - left_us;
    double newest_us = 0.5 * (earliest_us + latest_us);
    double step_us = period_us;
    if (d->fifo_known) {
        newest_us = fmin(fmax(d->fifo_us + period_us * batch->n, earliest_us), latest_us);
        step_us = (newest_us - d->fifo_us) / batch->n;
    }
    for (unsigned i = 0; i < batch->n; i++) {
        take_sample(d, (uint64_t)(newest_us - step_us * (batch->n - 1u - i) + 0.5), &batch->sample[i]);
    }
    d->fifo_us = newest_us;
    d->fifo_known = true;
}

static void empty_fifo(gc_device_t *d) {
    if (!d->sensor_ready || d->settings.fifo == 0.0) {
        return;
    }
    int error;
    do {
        error = gc_lsm6dso_fifo_read(&d->sensor, &d->batch);
        d->fifo_known = d->fifo_known && !d->batch.gap;
        if (d->batch.n > 0u) {
            take_batch(d);
        }
        if (d->batch.overrun) {
            d->overruns++;
            error = error == GC_OK ? GC_E_FIFO_OVERRUN : error;
        }
        judge_reading(d, d->batch.t_us, error);
    } while (d->batch.left > 0u && (error == GC_OK || error == GC_E_FIFO_OVERRUN));
}

/* ---- commands ---- */

typedef struct {
    gc_text_t word[4];
    unsigned n;
} gc_words_t;

static bool is(const gc_words_t *words, unsigned i, const char *text) {
    return i < words->n && gc_text_equals(words->word[i], text);
}

static int do_hello(gc_device_t *d, const gc_words_t *words) {
    (void)words;
    tell_ack(d, "hello");
    tell_hello(d);
    return GC_OK;
}

static int do_status(gc_device_t *d, const gc_words_t *words) {
    (void)words;
    tell_ack(d, "status");
    tell_status(d);
    return GC_OK;
}

static int do_start(gc_device_t *d, const gc_words_t *words) {
    const bool up = is(words, 1, "up");
    if (!up && !is(words, 1, "down")) {
        return GC_E_ARGUMENT;
    }
    empty_fifo(d); /* what it holds was before */
    if (d->recording) {
        return GC_E_RECORDING;
    }
    if (!d->sensor_ready) {
        return GC_E_NOT_READY;
    }
    tell_ack(d, "start");
    start_run(d, up ? 1 : -1, false);
    return GC_OK;
}

static int do_stop(gc_device_t *d, const gc_words_t *words) {
    (void)words;
    empty_fifo(d);
    if (!d->recording) {
        return GC_E_NO_RUN;
    }
    tell_ack(d, "stop");
    d->armed = false;
    stop_run(d);
    return GC_OK;
}

static bool has_correction(const gc_device_t *d) {
    const gc_correction_t *correction = d->results.correction;
    return correction[0].known || correction[1].known || correction[2].known;
}

static int do_stream(gc_device_t *d, const gc_words_t *words) {
    static const char *const names[] = {"off", "raw", "teleplot", "corrected"};
    for (unsigned i = 0; i < sizeof names / sizeof names[0]; i++) {
        if (is(words, 1, names[i])) {
            if (i == GC_STREAM_CORRECTED && !has_correction(d)) {
                return GC_E_NOT_CALIBRATED;
            }
            d->stream = (gc_stream_t)i;
            tell_ack(d, "stream");
            return GC_OK;
        }
    }
    return GC_E_ARGUMENT;
}

static int do_reset(gc_device_t *d, const gc_words_t *words) {
    (void)words;
    if (d->recording) {
        return GC_E_RECORDING;
    }
    forget_runs(d);
    for (size_t i = 0; i < 3u; i++) {
        d->rest[i].known = false;
    }
    if (d->stream == GC_STREAM_CORRECTED) {
        d->stream = GC_STREAM_OFF;
    }
    tell_ack(d, "reset");
    forget_results(d);
    return GC_OK;
}

static int do_dump(gc_device_t *d, const gc_words_t *words) {
    (void)words;
    if (d->recording) {
        return GC_E_RECORDING;
    }
    d->dump_line = 0;
    d->dump_lines = gc_kept_lines(&d->results, &d->windows);
    gc_sentence_t *s = begin(d, "ACK", now_us(d));
    gc_sentence_text(s, "cmd", "dump");
    gc_sentence_uint(s, "lines", d->dump_lines);
    finish(d);
    return GC_OK;
}

/* A few lines at a time, each when there is room for it. */
static void go_on_with_dump(gc_device_t *d) {
    for (unsigned i = 0; i < DUMP_LINES_A_STEP && d->dump_line < d->dump_lines; i++) {
        gc_sentence_t *s = begin(d, gc_kept_line_tag(&d->results, d->dump_line), now_us(d));
        gc_kept_line_fields(s, &d->results, &d->windows, d->dump_line);
        const int n = gc_sentence_end(s);
        if (n > 0 && d->config.port->send(d->config.port->context, s->text, (size_t)n) != n) {
            d->seq--;
            return;
        }
        d->dump_line++;
    }
}

static bool keep_settings(gc_device_t *d) {
    const gc_port_t *port = d->config.port;
    d->kept_settings.settings = d->settings;
    return port->store == NULL ||
           gc_store_save(port, "settings", SETTINGS_VERSION, &d->kept_settings.record, sizeof d->kept_settings) == GC_OK;
}

static bool settings_ok(const gc_settings_t *s) {
    return gc_lsm6dso_odr_for(s->rate_hz) > 0.0 && s->rate_hz >= 1.0 && gc_lsm6dso_full_scale_ok(s->full_scale_dps) &&
           !(fabs(s->table_dps) > 2000.0) && fabs(s->turn_deg) <= 1e6 && s->axis >= 0 && s->axis < 3 &&
           (s->automatic == 0 || s->automatic == 1) && s->fifo >= 0.0 && s->fifo <= GC_LSM6DSO_FIFO_BATCH_MAX &&
           s->fifo <= FIFO_LONGEST_S * s->rate_hz && s->fifo == floor(s->fifo);
}

static bool fifo_ok(const gc_settings_t *s) {
    return s->fifo == 0.0 || gc_lsm6dso_odr_for(s->rate_hz) == s->rate_hz;
}

static void recall_settings(gc_device_t *d) {
    gc_kept_settings_t *kept = &d->kept_settings;
    if (gc_store_load(d->config.port, "settings", SETTINGS_VERSION, &kept->record, sizeof *kept) == GC_OK &&
        settings_ok(&kept->settings) && fifo_ok(&kept->settings)) {
        d->settings = kept->settings;
    }
}

/* Takes changed settings: keeps them, and sets the sensor up again where it must know. */
static int change_settings(gc_device_t *d, const gc_settings_t *settings, const char *command) {
    if (!settings_ok(settings)) {
        return GC_E_ARGUMENT;
    }
    if (!fifo_ok(settings)) {
        return GC_E_FIFO_RATE;
    }
    const bool sensor = settings->rate_hz != d->settings.rate_hz || settings->full_scale_dps != d->settings.full_scale_dps ||
                        settings->fifo != d->settings.fifo;
    d->settings = *settings;
    tell_ack(d, command);
    if (!keep_settings(d)) {
        tell_error(d, GC_E_STORE);
    }
    if (sensor) {
        set_up_sensor(d);
        d->sample_us = 0;
    }
    return GC_OK;
}

static int do_auto(gc_device_t *d, const gc_words_t *words) {
    gc_settings_t settings = d->settings;
    if (!is(words, 1, "on") && !is(words, 1, "off")) {
        return GC_E_ARGUMENT;
    }
    settings.automatic = is(words, 1, "on") ? 1 : 0;
    d->armed = true;
    return change_settings(d, &settings, "auto");
}

static double *real_setting(gc_settings_t *settings, const gc_words_t *words) {
    if (is(words, 1, "rate_hz")) {
        return &settings->rate_hz;
    }
    if (is(words, 1, "full_scale_dps")) {
        return &settings->full_scale_dps;
    }
    if (is(words, 1, "table_dps")) {
        return &settings->table_dps;
    }
    if (is(words, 1, "fifo")) {
        return &settings->fifo;
    }
    return is(words, 1, "turn_deg") ? &settings->turn_deg : NULL;
}

static int do_set(gc_device_t *d, const gc_words_t *words) {
    gc_settings_t settings = d->settings;
    if (d->recording) {
        return GC_E_RECORDING;
    }
    double *real = real_setting(&settings, words);
    if (words->n != 3u || (real == NULL && !is(words, 1, "axis"))) {
        return GC_E_ARGUMENT;
    }
    if (real != NULL) {
        if (real == &settings.table_dps && is(words, 2, "none")) {
            *real = NAN;
        } else if (gc_parse_real(words->word[2].text, words->word[2].n, real) != GC_OK) {
            return GC_E_NUMBER;
        }
    } else {
        settings.axis = -1;
        for (int i = 0; i < 3; i++) {
            if (is(words, 2, axis_names[i])) {
                settings.axis = i;
            }
        }
    }
    return change_settings(d, &settings, "set");
}

static int do_get(gc_device_t *d, const gc_words_t *words) {
    static const char *const names[] = {"rate_hz", "full_scale_dps", "table_dps", "turn_deg", "fifo"};
    const double *real = real_setting(&d->settings, words);
    if (words->n != 2u || (real == NULL && !is(words, 1, "axis"))) {
        return GC_E_ARGUMENT;
    }
    gc_sentence_t *s = begin(d, "ACK", now_us(d));
    gc_sentence_text(s, "cmd", "get");
    if (real == NULL) {
        gc_sentence_text(s, "axis", axis_names[d->settings.axis]);
    }
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        if (real != NULL && is(words, 1, names[i])) {
            gc_sentence_real(s, names[i], *real);
        }
    }
    finish(d);
    return GC_OK;
}

static const struct {
    const char *name;
    int (*act)(gc_device_t *d, const gc_words_t *words);
} commands[] = {
    {"hello", do_hello}, {"status", do_status}, {"start", do_start}, {"auto", do_auto}, {"stop", do_stop},
    {"stream", do_stream}, {"set", do_set}, {"get", do_get}, {"reset", do_reset}, {"dump", do_dump},
};

static void obey(gc_device_t *d, const char *line, size_t n) {
    gc_words_t words = {.n = 0};
    size_t i = 0;
    int error = GC_E_COMMAND;
    while (i < n) {
        while (i < n && (line[i] == ' ' || line[i] == '\t')) {
            i++;
        }
        const size_t from = i;
        while (i < n && line[i] != ' ' && line[i] != '\t') {
            i++;
        }
        if (i > from) {
            if (words.n == sizeof words.word / sizeof words.word[0]) {
                tell_error(d, GC_E_ARGUMENT);
                return;
            }
            words.word[words.n].text = line + from;
            words.word[words.n++].n = i - from;
        }
    }
    if (words.n == 0u) {
        return;
    }
    for (size_t k = 0; k < sizeof commands / sizeof commands[0]; k++) {
        if (is(&words, 0, commands[k].name)) {
            error = commands[k].act(d, &words);
        }
    }
    if (error != GC_OK) {
        tell_error(d, error);
    }
    show_led(d);
}

void gc_device_receive(gc_device_t *d, const char *data, size_t n) {
    for (size_t i = 0; i < n; i++) {
        const int got = gc_line_push(&d->reader, data[i]);
        if (got == 1) {
            obey(d, d->reader.line, d->reader.n);
        } else if (got < 0) {
            tell_error(d, got);
        }
    }
}

/* ---- the loop ---- */

void gc_device_init(gc_device_t *d, const gc_device_config_t *config) {
    memset(d, 0, sizeof *d);
    d->config = *config;
    d->misfit = NAN;
    d->misfits = false;
    d->armed = true;
    gc_line_reader_init(&d->reader, d->command, GC_COMMAND_MAX);
    d->settings = (gc_settings_t){.rate_hz = 145.0, .full_scale_dps = 250.0, .table_dps = 78.0, .axis = 2};
    int error = GC_OK;
    const gc_calibration_t *calibration = config->calibration;
    if (calibration != NULL) {
        if (calibration->rate_hz > 0.0f) {
            d->settings.rate_hz = (double)calibration->rate_hz;
        }
        if (calibration->table_dps != 0.0f) {
            d->settings.table_dps = (double)calibration->table_dps;
        }
        d->settings.axis = calibration->axis == 'x' ? 0 : calibration->axis == 'y' ? 1 : 2;
        error = gc_estimator_check(calibration);
        d->model = error == GC_OK && gc_estimator_has_model(calibration);
    }
    recall_settings(d);
    recall_results(d);
    set_up_sensor(d);
    tell_hello(d);
    if (error != GC_OK) {
        tell_error(d, error);
    }
    show_led(d);
}

/* Waits for the next sample; returns the time at which to read it. */
static uint64_t wait_for_sample(gc_device_t *d) {
    const gc_port_t *port = d->config.port;
    void (*const wait)(void *, uint64_t) = port->wait_sample_us != NULL ? port->wait_sample_us : port->wait_until_us;
    const double period_us = 1e6 / d->settings.rate_hz;
    if (d->settings.rate_hz != d->sensor.odr_hz) { /* a tick that is over is made up for at once, of several the last */
        const uint64_t over = (uint64_t)((double)(now_us(d) - d->epoch_us) / period_us);
        d->tick = over > d->tick ? over : d->tick + 1u;
        wait(port->context, d->epoch_us + (uint64_t)((double)d->tick * period_us + 0.5));
        return now_us(d);
    }
    const uint64_t start = now_us(d);
    if (port->wait_ready_us != NULL) {
        port->wait_ready_us(port->context, start + (uint64_t)(1.5 * period_us));
    } else {
        wait(port->context, start + (uint64_t)(0.5 * period_us));
    }
    for (;;) {
        const uint64_t now = now_us(d);
        const int ready = gc_lsm6dso_ready(&d->sensor);
        if (ready != 0 || (double)(now - start) > 4.0 * period_us) {
            return now; /* what is wrong, if something is, the reading will tell */
        }
        port->wait_until_us(port->context, now + READY_POLL_US);
    }
}

/* Until the FIFO holds a batch. */
static void wait_for_batch(gc_device_t *d) {
    const gc_port_t *port = d->config.port;
    void (*const wait)(void *, uint64_t) = port->wait_sample_us != NULL ? port->wait_sample_us : port->wait_until_us;
    const double batch_us = d->settings.fifo * d->sensor.period_us;
    if (port->wait_ready_us != NULL) {
        port->wait_ready_us(port->context, now_us(d) + (uint64_t)(1.5 * batch_us));
    } else {
        wait(port->context, d->batch.t_us + (uint64_t)batch_us);
    }
}

void gc_device_step(gc_device_t *d) {
    const gc_port_t *port = d->config.port;
    go_on_with_dump(d);
    if (!d->sensor_ready) {
        port->wait_until_us(port->context, now_us(d) + IDLE_SLICE_US);
        if (now_us(d) >= d->retry_us) {
            set_up_sensor(d);
            d->resets++;
        }
        return;
    }
    if (d->settings.fifo > 0.0) {
        wait_for_batch(d);
        empty_fifo(d);
        return;
    }
    const uint64_t t_us = wait_for_sample(d);
    gc_sample_t sample;
    const int error = gc_lsm6dso_read(&d->sensor, &sample);
    judge_reading(d, t_us, error);
    if (error != GC_OK) {
        return;
    }
    if (!sample.fresh) { /* a reading that was there before says nothing new */
        d->stale++;
        return;
    }
    take_sample(d, t_us, &sample);
}
