/* The calibrations that a device stores in flash: answers, the corrections from them, and the raw counts behind them. */
#ifndef GC_KEPT_H
#define GC_KEPT_H

#include "gc_baseline.h"
#include "gc_net.h"
#include "gc_store.h"
#include "gc_tell.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GC_KEPT_ANSWERS 30u /* three axes: nine of a pair, and one at rest or of a turn */

typedef enum { GC_METHOD_BASELINE, GC_METHOD_CNN, GC_METHOD_MODEL, GC_METHOD_REST, GC_METHOD_TURN } gc_method_t;

/* An answer with the fields of a $CAL. */
typedef struct {
    uint64_t t_us;
    uint64_t first, last; /* sample numbers since boot */
    double seconds;
    double temp_c;
    gc_answer_t answer;
    int32_t method; /* gc_method_t */
    int32_t axis;
    uint32_t flags; /* gc_flags.h; none = it is trusted */
    uint32_t reserved;
} gc_kept_answer_t;

/* reading = (1 + scale) rate + bias. */
typedef struct {
    double scale;
    double bias_dps;
    int32_t known;
    int32_t method;
} gc_correction_t;

typedef struct {
    gc_record_t record;
    uint32_t n; /* number of answers so far; number i is stored at i % GC_KEPT_ANSWERS */
    uint32_t net; /* identity of the network whose answers they are */
    gc_kept_answer_t answer[GC_KEPT_ANSWERS];
    gc_correction_t correction[3];
    gc_correction_t previous; /* the corrections that `undo` restores */
    int32_t undo_axis;        /* the axis that `undo` restores; -1 = none */
    int32_t reserved;
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

typedef struct {
    gc_results_t results;
    gc_windows_t windows;
    bool results_changed, windows_changed; /* changed since they were saved */
    uint32_t dump_line, dump_lines;        /* the next sentence of the dump, and their number */
} gc_kept_t;

/* Loads records that are whole and within their ranges. Answers and corrections of a network whose identity is not `net` are
   dropped. */
void gc_kept_load(gc_kept_t *kept, const gc_port_t *port, uint32_t net);
/* Saves the records that changed. Call it between runs only, because a write to flash takes longer than a sample can wait. Returns
   GC_OK, or GC_E_STORE if it failed. */
int gc_kept_save(gc_kept_t *kept, const gc_port_t *port);
/* Forgets everything that is kept. The next gc_kept_save makes it permanent. */
void gc_kept_forget(gc_kept_t *kept);

/* Sends an answer as $CAL and stores it. */
void gc_kept_add(gc_kept_t *kept, gc_teller_t *teller, const gc_kept_answer_t *answer);
/* Makes a trusted answer the correction of its axis. An answer at rest renews only the bias of an axis with a correction. An
   answer with a flag changes nothing. */
void gc_kept_correct_by(gc_kept_t *kept, const gc_kept_answer_t *answer);
/* Restores the correction before the last one. Returns the axis, or GC_E_NO_UNDO. */
int gc_kept_undo(gc_kept_t *kept);
/* An empty window for a run that begins; a dump in progress ends. */
gc_window_t *gc_kept_begin_window(gc_kept_t *kept, unsigned sense);

bool gc_kept_has_correction(const gc_kept_t *kept);
/* Returns the corrected rate in dps; NaN for an axis without a correction. */
double gc_kept_corrected(const gc_kept_t *kept, unsigned axis, double measured_dps);

/* Sends everything that is kept as $OLD and $WIN sentences. After the beginning, each call of gc_kept_go_on_with_dump sends a few,
   as far as there is room for them. */
void gc_kept_begin_dump(gc_kept_t *kept);
void gc_kept_end_dump(gc_kept_t *kept);
void gc_kept_go_on_with_dump(gc_kept_t *kept, gc_teller_t *teller);

#ifdef __cplusplus
}
#endif

#endif
