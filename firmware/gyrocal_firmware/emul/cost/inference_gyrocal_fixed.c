/* Network `gyrocal` on the raw counts of 6 s of two runs, its layers in integers. */
#include "inference_gyrocal.c"
