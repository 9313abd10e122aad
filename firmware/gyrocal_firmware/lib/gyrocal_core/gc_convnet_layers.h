/* The layers of network `gyrocal`, which gc_convnet_float.c computes in float32 and gc_convnet_fixed.c in integers. */
#ifndef GC_CONVNET_LAYERS_H
#define GC_CONVNET_LAYERS_H

#include "gc_convnet.h"

/* Sizes at a stage: columns, and times in the outputs of the two convolutions. */
uint32_t gc_convnet_columns(const gc_convnet_t *net, unsigned stage);
uint32_t gc_convnet_first_times(const gc_convnet_t *net, unsigned stage);
uint32_t gc_convnet_second_times(const gc_convnet_t *net, unsigned stage);

/* Sets the columns. off: their means less that of all readings, in counts times a divisor; gain: one of these in units. */
void gc_convnet_set_columns(const gc_convnet_t *net, gc_convnet_work_t *work, const int64_t *off, double gain);
/* Computes the next part of the layers. Returns true when work->out is complete. */
bool gc_convnet_next_part(const gc_convnet_t *net, gc_convnet_work_t *work);

#endif
