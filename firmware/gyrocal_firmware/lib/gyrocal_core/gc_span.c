#include "gc_span.h"

bool gc_span_holds(const gc_span_t *span, float value) {
    return !(span->min < span->max) || !(value < span->min || value > span->max);
}

float gc_span_clamp(const gc_span_t *span, float value) {
    if (gc_span_holds(span, value)) {
        return value;
    }
    return value < span->min ? span->min : span->max;
}
