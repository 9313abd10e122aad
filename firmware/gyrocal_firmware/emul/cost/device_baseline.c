/* One sample through the whole device without model, network and stream: what one takes at a rate that the wire does not carry. */
#define CALIBRATION NULL
#define NETWORK NULL
#define STREAM "off"
#include "whole_device.h"
