/* One sample through the whole device: bus, driver, baseline, estimator with eight effect columns, $RAW; its largest is an answer
   after 6 s, by baseline and model or a face of the network's. */
#include "eight_columns.h"

#define CALIBRATION &eight_column_calibration
#define NETWORK &gc_net
#define STREAM "raw"
#include "whole_device.h"
