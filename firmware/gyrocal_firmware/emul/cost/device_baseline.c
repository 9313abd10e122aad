/* The same without model and stream: what a sample takes at a rate that the wire does not carry. */
#define CALIBRATION NULL
#define STREAM "off"
#include "whole_device.h"
