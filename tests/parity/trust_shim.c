/* The core's standard errors, flags and mathematics on arrays, for ctypes. */

#include "gc_error.h"
#include "gc_judge.h"
#include "gc_math.h"
#include "gc_trust.h"
#include <math.h>

int trust(const int64_t *t_us, const int16_t *counts, const uint32_t *n, const double *w, double rate_hz, double lsb,
          uint32_t blocks, int known_table, double *answer, char *flags)
{
    static gc_face_t face[2];
    static gc_evidence_t evidence;
    for (unsigned i = 0; i < 2; i++) {
        gc_face_begin(&face[i], rate_hz, w[i]);
        for (uint32_t k = 0; k < n[i]; k++) {
            gc_face_add(&face[i], (uint64_t)*t_us++, *counts++);
        }
    }
    const int error = gc_evidence_begin(&evidence, &face[0], &face[1], blocks, w[0], w[1], lsb);
    if (error != GC_OK) {
        return error;
    }
    while (!gc_evidence_go_on(&evidence)) {
    }
    gc_answer_t base = {answer[0], 0, answer[2], 0, 0}, net = {answer[0], answer[1], answer[2], answer[3], 0};
    gc_evidence_errors(&evidence, &base);
    gc_flags_text(gc_evidence_judge(&evidence, known_table != 0, &net) | gc_judge_answer(&base, 2.0 * blocks), flags);
    answer[0] = base.scale_se;
    answer[1] = base.bias_se_dps;
    answer[2] = base.misfit;
    answer[3] = net.misfit;
    answer[4] = net.scale_se;
    answer[5] = net.bias_se_dps;
    return GC_OK;
}

uint32_t last_turn(const int64_t *t_us, const int16_t *counts, uint32_t n, double rate_hz, double w, uint64_t after_us, double *mean)
{
    static gc_face_t face;
    gc_face_begin(&face, rate_hz, w);
    for (uint32_t k = 0; k < n; k++) {
        gc_face_add(&face, (uint64_t)t_us[k], counts[k]);
    }
    return gc_face_last_turn(&face, after_us, mean);
}

void logs_and_decays(const double *x, uint32_t n, double *logs, double *decays)
{
    for (uint32_t i = 0; i < n; i++) {
        logs[i] = gc_log(x[i]);
        decays[i] = gc_decay(x[i]);
    }
}

unsigned flags_room(void) { return GC_FLAGS_TEXT_MAX; }
