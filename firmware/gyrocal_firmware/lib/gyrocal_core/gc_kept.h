/* What a device keeps of its calibrations, over power-off too: answers, what they correct, and the raw counts behind them. */
#ifndef GC_KEPT_H
#define GC_KEPT_H

#include "gc_baseline.h"
#include "gc_store.h"
#include "gc_wire.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GC_KEPT_ANSWERS 30u /* three axes: nine of a pair, and one at rest or of a turn */

#ifndef GC_MAX_CNN_WINDOW
#define GC_MAX_CNN_WINDOW 290 /* samples of one window */
#endif
#ifndef GC_MAX_CNN_SAMPLES
#define GC_MAX_CNN_SAMPLES (3 * GC_MAX_CNN_WINDOW) /* kept of each run */
#endif

typedef enum { GC_METHOD_BASELINE, GC_METHOD_CNN, GC_METHOD_MODEL, GC_METHOD_REST, GC_METHOD_TURN } gc_method_t;
const char *gc_method_name(gc_method_t method);

/* One $CAL. */
typedef struct {
    uint64_t t_us;
    uint64_t first, last; /* sample numbers since boot */
    double seconds;
    double temp_c;
    gc_answer_t answer;
    int32_t method; /* gc_method_t */
    int32_t axis;
} gc_kept_answer_t;

/* reading = (1 + scale) rate + bias; of the richest method that answered for the axis, model before cnn before baseline. */
typedef struct {
    double scale;
    double bias_dps;
    int32_t known;
    int32_t method;
} gc_correction_t;

typedef struct {
    gc_record_t record;
    uint32_t n; /* answers so far; number i stands at i % GC_KEPT_ANSWERS */
    uint32_t reserved;
    gc_kept_answer_t answer[GC_KEPT_ANSWERS];
    gc_correction_t correction[3];
} gc_results_t;

/* The first seconds of a run, in raw counts of its axis. */
typedef struct {
    double rate_hz;
    double lsb_dps;
    double w_dps;
    int32_t face;
    int32_t axis;
    uint32_t n;
    uint32_t reserved;
    int16_t counts[GC_MAX_CNN_SAMPLES];
} gc_window_t;

typedef struct {
    gc_record_t record;
    gc_window_t run[2]; /* true rate positive, negative */
} gc_windows_t;

/* Keeps an answer and lets it correct its axis; new_pair: whatever corrected it before gives way. An answer at rest renews
   the bias of an axis that has a correction. */
void gc_results_add(gc_results_t *results, const gc_kept_answer_t *answer, bool new_pair);

/* NaN for an axis without a correction. */
double gc_results_correct(const gc_results_t *results, unsigned axis, double measured_dps);

/* The fields of a $CAL. */
void gc_kept_answer_fields(gc_sentence_t *s, const gc_kept_answer_t *kept);

/* Sentences that tell everything kept, and the fields of one of them after its tag, $OLD or $WIN. */
uint32_t gc_kept_lines(const gc_results_t *results, const gc_windows_t *windows);
const char *gc_kept_line_tag(const gc_results_t *results, uint32_t line);
void gc_kept_line_fields(gc_sentence_t *s, const gc_results_t *results, const gc_windows_t *windows, uint32_t line);

#ifdef __cplusplus
}
#endif

#endif
