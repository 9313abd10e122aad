#include "gc_kept.h"

#include "gc_error.h"
#include "gc_flags.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#define RESULTS_VERSION 2u /* version of the layout of gc_results_t; records of another version are not loaded */
#define WINDOWS_VERSION 1u /* version of the layout of gc_windows_t */
#define COUNTS_A_LINE 16u  /* readings in one $WIN, which then fits GC_WIRE_MAX */
#define DUMP_LINES_A_STEP 4u /* sentences of a dump between two samples */

static const char *const method_names[] = {"baseline", "cnn", "model", "rest", "turn"};

static bool is_number(double x) {
    return x - x == 0.0;
}

static bool is_axis(int32_t axis) {
    return axis >= 0 && axis < 3;
}

static bool is_method(int32_t method) {
    return method >= GC_METHOD_BASELINE && method <= GC_METHOD_TURN;
}

static bool correction_ok(const gc_correction_t *c, bool same_net) {
    return c->known != 0 && is_method(c->method) && is_number(c->scale) && c->scale > -1.0 && is_number(c->bias_dps) &&
           (same_net || c->method != GC_METHOD_CNN);
}

static void check_results(gc_results_t *results, uint32_t net) {
    const bool same_net = results->net == net;
    const uint32_t n = results->n < GC_KEPT_ANSWERS ? results->n : GC_KEPT_ANSWERS;
    bool good = same_net;
    for (uint32_t i = 0; i < n; i++) {
        good = good && is_method(results->answer[i].method) && is_axis(results->answer[i].axis);
    }
    results->n = good ? results->n : 0u;
    for (unsigned i = 0; i < 3u; i++) {
        if (!correction_ok(&results->correction[i], same_net)) {
            memset(&results->correction[i], 0, sizeof results->correction[i]);
        }
    }
    if (!correction_ok(&results->previous, same_net)) {
        memset(&results->previous, 0, sizeof results->previous);
    }
    results->undo_axis = is_axis(results->undo_axis) ? results->undo_axis : -1;
    results->net = net;
}

static void check_windows(gc_windows_t *windows) {
    for (unsigned i = 0; i < 2u; i++) {
        if (windows->run[i].n > GC_MAX_CNN_SAMPLES || !is_axis(windows->run[i].axis)) {
            memset(&windows->run[i], 0, sizeof windows->run[i]);
        }
    }
}

void gc_kept_load(gc_kept_t *kept, const gc_port_t *port, uint32_t net) {
    memset(kept, 0, sizeof *kept);
    if (gc_store_load(port, "results", RESULTS_VERSION, &kept->results.record, sizeof kept->results) != GC_OK) {
        kept->results.undo_axis = -1;
    }
    (void)gc_store_load(port, "windows", WINDOWS_VERSION, &kept->windows.record, sizeof kept->windows);
    check_results(&kept->results, net);
    check_windows(&kept->windows);
}

int gc_kept_save(gc_kept_t *kept, const gc_port_t *port) {
    int error = GC_OK;
    if (port->store != NULL && kept->results_changed) {
        error = gc_store_save(port, "results", RESULTS_VERSION, &kept->results.record, sizeof kept->results);
    }
    if (port->store != NULL && kept->windows_changed && error == GC_OK) {
        error = gc_store_save(port, "windows", WINDOWS_VERSION, &kept->windows.record, sizeof kept->windows);
    }
    kept->results_changed = false;
    kept->windows_changed = false;
    return error;
}

void gc_kept_forget(gc_kept_t *kept) {
    const gc_record_t results = kept->results.record;
    const gc_record_t windows = kept->windows.record;
    const uint32_t net = kept->results.net;
    memset(&kept->results, 0, sizeof kept->results);
    memset(&kept->windows, 0, sizeof kept->windows);
    kept->results.record = results;
    kept->results.net = net;
    kept->results.undo_axis = -1;
    kept->windows.record = windows;
    kept->dump_lines = 0;
    kept->results_changed = true;
    kept->windows_changed = true;
}

gc_window_t *gc_kept_begin_window(gc_kept_t *kept, unsigned sense) {
    gc_window_t *window = &kept->windows.run[sense];
    memset(window, 0, sizeof *window);
    kept->windows_changed = true;
    return window;
}

static void answer_fields(gc_sentence_t *s, const gc_kept_answer_t *kept) {
    gc_sentence_text(s, "method", method_names[kept->method]);
    gc_sentence_real(s, "seconds", kept->seconds);
    gc_sentence_text(s, "axis", gc_axis_name(kept->axis));
    gc_sentence_real(s, "scale", kept->answer.scale);
    gc_sentence_real(s, "scale_se", kept->answer.scale_se);
    gc_sentence_real(s, "bias_dps", kept->answer.bias_dps);
    gc_sentence_real(s, "bias_se_dps", kept->answer.bias_se_dps);
    gc_sentence_real(s, "temp_c", kept->temp_c);
    gc_sentence_real(s, "misfit", kept->answer.misfit);
    gc_sentence_uint(s, "first", kept->first);
    gc_sentence_uint(s, "last", kept->last);
    char flags[GC_FLAGS_TEXT_MAX];
    (void)gc_flags_text(kept->flags, flags);
    gc_sentence_text(s, "flags", flags);
    gc_sentence_uint(s, "trusted", kept->flags == 0u ? 1u : 0u);
}

void gc_kept_add(gc_kept_t *kept, gc_teller_t *teller, const gc_kept_answer_t *answer) {
    gc_results_t *results = &kept->results;
    answer_fields(gc_tell_begin_at(teller, "CAL", answer->t_us), answer);
    gc_tell_end(teller);
    results->answer[results->n++ % GC_KEPT_ANSWERS] = *answer;
    kept->results_changed = true;
}

void gc_kept_correct_by(gc_kept_t *kept, const gc_kept_answer_t *answer) {
    gc_results_t *results = &kept->results;
    gc_correction_t *correction = &results->correction[answer->axis];
    const bool rest = answer->method == GC_METHOD_REST;
    if (answer->flags != 0u || (rest && correction->known == 0)) {
        return;
    }
    results->previous = *correction;
    results->undo_axis = answer->axis;
    correction->bias_dps = answer->answer.bias_dps;
    if (!rest) {
        correction->known = 1;
        correction->method = answer->method;
        correction->scale = answer->answer.scale;
    }
    kept->results_changed = true;
}

int gc_kept_undo(gc_kept_t *kept) {
    gc_results_t *results = &kept->results;
    const int32_t axis = results->undo_axis;
    if (axis < 0) {
        return GC_E_NO_UNDO;
    }
    results->correction[axis] = results->previous;
    results->undo_axis = -1;
    kept->results_changed = true;
    return axis;
}

bool gc_kept_has_correction(const gc_kept_t *kept) {
    const gc_correction_t *correction = kept->results.correction;
    return correction[0].known || correction[1].known || correction[2].known;
}

double gc_kept_corrected(const gc_kept_t *kept, unsigned axis, double measured_dps) {
    const gc_correction_t *correction = &kept->results.correction[axis];
    return correction->known ? (measured_dps - correction->bias_dps) / (1.0 + correction->scale) : NAN;
}

/* ---- dump ---- */

static uint32_t answers(const gc_results_t *results) {
    return results->n < GC_KEPT_ANSWERS ? results->n : GC_KEPT_ANSWERS;
}

static uint32_t window_lines(const gc_window_t *window) {
    return (window->n + COUNTS_A_LINE - 1u) / COUNTS_A_LINE;
}

static void window_fields(gc_sentence_t *s, const gc_window_t *window, uint32_t line) {
    const uint32_t at = line * COUNTS_A_LINE;
    gc_sentence_text(s, "face", gc_face_name(window->face));
    gc_sentence_text(s, "axis", gc_axis_name(window->axis));
    gc_sentence_real(s, "rate_hz", window->rate_hz);
    gc_sentence_real(s, "w_dps", window->w_dps);
    gc_sentence_real(s, "lsb_dps", window->lsb_dps);
    gc_sentence_uint(s, "n", window->n);
    gc_sentence_uint(s, "at", at);
    for (uint32_t i = at; i < at + COUNTS_A_LINE && i < window->n; i++) {
        gc_sentence_int(s, NULL, window->counts[i]);
    }
}

void gc_kept_begin_dump(gc_kept_t *kept) {
    kept->dump_line = 0;
    kept->dump_lines = answers(&kept->results) + window_lines(&kept->windows.run[0]) + window_lines(&kept->windows.run[1]);
}

void gc_kept_end_dump(gc_kept_t *kept) {
    kept->dump_lines = 0;
}

/* Answers, the oldest first, then the counts of both runs. */
static void begin_line(const gc_kept_t *kept, gc_teller_t *teller) {
    const gc_results_t *results = &kept->results;
    const uint32_t n = answers(results);
    const uint32_t first = window_lines(&kept->windows.run[0]);
    uint32_t line = kept->dump_line;
    if (line < n) {
        answer_fields(gc_tell_begin(teller, "OLD"), &results->answer[(results->n - n + line) % GC_KEPT_ANSWERS]);
        return;
    }
    line -= n;
    gc_sentence_t *s = gc_tell_begin(teller, "WIN");
    if (line < first) {
        window_fields(s, &kept->windows.run[0], line);
    } else {
        window_fields(s, &kept->windows.run[1], line - first);
    }
}

void gc_kept_go_on_with_dump(gc_kept_t *kept, gc_teller_t *teller) {
    for (unsigned i = 0; i < DUMP_LINES_A_STEP && kept->dump_line < kept->dump_lines; i++) {
        begin_line(kept, teller);
        if (!gc_tell_end_or_wait(teller)) {
            return;
        }
        kept->dump_line++;
    }
}
