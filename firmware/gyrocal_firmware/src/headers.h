/* The generated headers are compiled as C. */
#ifndef HEADERS_H
#define HEADERS_H

#include "gc_calibration.h"
#include "gc_cnn.h"

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

extern const gc_calibration_t *const gyrocal_calibration;
extern const gc_cnn_net_t *const gyrocal_net;
extern const uint8_t *const gyrocal_part_file; /* NULL if there is none */
extern const size_t gyrocal_part_file_bytes;

#ifdef __cplusplus
}
#endif

#endif
