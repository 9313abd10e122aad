#include "headers.h"

#include "calibration.h"
#include "part_file.h"
#include "weights.h"

const gc_calibration_t *const gyrocal_calibration = &gc_calibration;
const gc_cnn_net_t *const gyrocal_net = &gc_net;

#if PART_FILE_BYTES > 0
const uint8_t *const gyrocal_part_file = part_file;
#else
const uint8_t *const gyrocal_part_file = NULL;
#endif
const size_t gyrocal_part_file_bytes = PART_FILE_BYTES;
