#include "headers.h"

#include "calibration.h"
#include "weights.h"

const gc_calibration_t *const gyrocal_calibration = &gc_calibration;
const gc_cnn_net_t *const gyrocal_net = &gc_net;
