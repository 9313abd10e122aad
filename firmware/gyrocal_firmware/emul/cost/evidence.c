/* Standard errors, misfit and the judgement of a network's answer after 6 s, in its parts. */
#include "cost.h"
#include "gc_trust.h"

const unsigned cost_times = GC_EVIDENCE_PARTS + 2u;

static gc_face_t face;
static gc_evidence_t evidence;
static gc_answer_t answer = {0.004, 1e-4, 0.1, 1e-2, 1.0};
static unsigned part;

void cost_prepare(void) {
    gc_face_begin(&face, 145.0, 78.0);
    for (unsigned i = 0; i < 870u; i++) {
        gc_face_add(&face, (uint64_t)(1e6 * (double)i / 145.0 + 0.5), (int16_t)(8950 + (int)(i * 7u % 23u)));
    }
}

void cost_act(void) {
    if (part == 0u) {
        (void)gc_evidence_begin(&evidence, &face, &face, GC_FACE_BLOCKS, 78.0, -78.0, 0.00875);
    }
    if (part < GC_EVIDENCE_PARTS) {
        (void)gc_evidence_go_on(&evidence);
    } else if (part == GC_EVIDENCE_PARTS) {
        gc_evidence_errors(&evidence, &answer);
    } else {
        (void)gc_evidence_judge(&evidence, false, &answer);
    }
    part = (part + 1u) % cost_times;
}
