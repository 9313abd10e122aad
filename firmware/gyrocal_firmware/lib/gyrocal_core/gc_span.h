/* The span of a quantity that a model was fitted on. */
#ifndef GC_SPAN_H
#define GC_SPAN_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Nothing is known of a span unless min < max; every value is within it then. So is NaN, a quantity that is not measured. */
typedef struct {
    float min;
    float max;
} gc_span_t;

/* Returns whether a value is within the span. */
bool gc_span_holds(const gc_span_t *span, float value);
/* Returns the value, or the end of the span that is nearest to it. */
float gc_span_clamp(const gc_span_t *span, float value);

#ifdef __cplusplus
}
#endif

#endif
