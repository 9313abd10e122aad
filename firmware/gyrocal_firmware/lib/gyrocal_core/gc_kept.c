#include "gc_kept.h"

#include "gc_error.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#define RESULTS_VERSION 2u /* an older network's answers are not recalled */
#define WINDOWS_VERSION 1u
#define COUNTS_A_LINE 16u
#define DUMP_LINES_A_STEP 4u

static const char *const method_names[] = {"baseline", "cnn", "model", "rest", "turn"};

void gc_kept_load(gc_kept_t *kept, const gc_port_t *port) {
    memset(kept, 0, sizeof *kept);
    (void)gc_store_load(port, "results", RESULTS_VERSION, &kept->results.record, sizeof kept->results);
    (void)gc_store_load(port, "windows", WINDOWS_VERSION, &kept->windows.record, sizeof kept->windows);
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
    memset(&kept->results, 0, sizeof kept->results);
    memset(&kept->windows, 0, sizeof kept->windows);
    kept->results.record = results;
    kept->windows.record = windows;
    kept->results_changed = true;
    kept->windows_changed = true;
}

gc_window_t *gc_kept_begin_window(gc_kept_t *kept, unsigned sense) {
    gc_window_t *window = &kept->windows.run[sense];
    memset(window, 0, sizeof *window);
    kept->windows_changed = true;
    return window;
}

static void keep(gc_results_t *results, const gc_kept_answer_t *answer, bool new_pair) {
    gc_correction_t *correction = &results->correction[answer->axis];
    results->answer[results->n++ % GC_KEPT_ANSWERS] = *answer;
    if (answer->method == GC_METHOD_REST) {
        if (correction->known) {
            correction->bias_dps = answer->answer.bias_dps;
        }
    } else if (new_pair || answer->method == GC_METHOD_TURN || answer->method >= correction->method) {
        correction->known = 1;
        correction->method = answer->method;
        correction->scale = answer->answer.scale;
        correction->bias_dps = answer->answer.bias_dps;
    }
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
}

void gc_kept_add(gc_kept_t *kept, gc_teller_t *teller, const gc_kept_answer_t *answer, bool new_pair) {
    answer_fields(gc_tell_begin_at(teller, "CAL", answer->t_us), answer);
    gc_tell_end(teller);
    keep(&kept->results, answer, new_pair);
    kept->results_changed = true;
}

bool gc_kept_has_correction(const gc_kept_t *kept) {
    const gc_correction_t *correction = kept->results.correction;
    return correction[0].known || correction[1].known || correction[2].known;
}

double gc_kept_correct(const gc_kept_t *kept, unsigned axis, double measured_dps) {
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
