/* The parts that the core has drivers for, as a list that ends with NULL: for gc_device_config_t.parts. A board that needs fewer
   makes a list of its own, and only their drivers are linked. New parts go to the end: the setting `sensor` is kept by number. */
#ifndef GC_PARTS_H
#define GC_PARTS_H

#include "gc_sensor.h"

#ifdef __cplusplus
extern "C" {
#endif

extern const gc_part_t *const gc_parts[];

#ifdef __cplusplus
}
#endif

#endif
