#include "gc_kept.h"

#include <math.h>
#include <stddef.h>

#define COUNTS_A_LINE 16u

static const char *const method_names[] = {"baseline", "cnn", "model", "rest", "turn"};
static const char *const axis_names[] = {"x", "y", "z"};

const char *gc_method_name(gc_method_t method) {
    return method_names[method];
}

void gc_results_add(gc_results_t *results, const gc_kept_answer_t *answer, bool new_pair) {
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

double gc_results_correct(const gc_results_t *results, unsigned axis, double measured_dps) {
    const gc_correction_t *correction = &results->correction[axis];
    return correction->known ? (measured_dps - correction->bias_dps) / (1.0 + correction->scale) : NAN;
}

void gc_kept_answer_fields(gc_sentence_t *s, const gc_kept_answer_t *kept) {
    gc_sentence_text(s, "method", method_names[kept->method]);
    gc_sentence_real(s, "seconds", kept->seconds);
    gc_sentence_text(s, "axis", axis_names[kept->axis]);
    gc_sentence_real(s, "scale", kept->answer.scale);
    gc_sentence_real(s, "scale_se", kept->answer.scale_se);
    gc_sentence_real(s, "bias_dps", kept->answer.bias_dps);
    gc_sentence_real(s, "bias_se_dps", kept->answer.bias_se_dps);
    gc_sentence_real(s, "temp_c", kept->temp_c);
    gc_sentence_real(s, "misfit", kept->answer.misfit);
    gc_sentence_uint(s, "first", kept->first);
    gc_sentence_uint(s, "last", kept->last);
}

static uint32_t answers(const gc_results_t *results) {
    return results->n < GC_KEPT_ANSWERS ? results->n : GC_KEPT_ANSWERS;
}

static uint32_t window_lines(const gc_window_t *window) {
    return (window->n + COUNTS_A_LINE - 1u) / COUNTS_A_LINE;
}

uint32_t gc_kept_lines(const gc_results_t *results, const gc_windows_t *windows) {
    return answers(results) + window_lines(&windows->run[0]) + window_lines(&windows->run[1]);
}

const char *gc_kept_line_tag(const gc_results_t *results, uint32_t line) {
    return line < answers(results) ? "OLD" : "WIN";
}

static void window_fields(gc_sentence_t *s, const gc_window_t *window, uint32_t line) {
    const uint32_t at = line * COUNTS_A_LINE;
    gc_sentence_text(s, "face", window->face > 0 ? "up" : "down");
    gc_sentence_text(s, "axis", axis_names[window->axis]);
    gc_sentence_real(s, "rate_hz", window->rate_hz);
    gc_sentence_real(s, "w_dps", window->w_dps);
    gc_sentence_real(s, "lsb_dps", window->lsb_dps);
    gc_sentence_uint(s, "n", window->n);
    gc_sentence_uint(s, "at", at);
    for (uint32_t i = at; i < at + COUNTS_A_LINE && i < window->n; i++) {
        gc_sentence_int(s, NULL, window->counts[i]);
    }
}

void gc_kept_line_fields(gc_sentence_t *s, const gc_results_t *results, const gc_windows_t *windows, uint32_t line) {
    const uint32_t n = answers(results);
    if (line < n) { /* the oldest first */
        gc_kept_answer_fields(s, &results->answer[(results->n - n + line) % GC_KEPT_ANSWERS]);
        return;
    }
    const uint32_t first = window_lines(&windows->run[0]);
    if (line - n < first) {
        window_fields(s, &windows->run[0], line - n);
    } else {
        window_fields(s, &windows->run[1], line - n - first);
    }
}
