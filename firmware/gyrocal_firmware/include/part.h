/* The sensor that the firmware is built for. To build for another one, name its driver and its addresses here, and its register
   file in sim/emul.h. */
#ifndef PART_H
#define PART_H

#include "gc_lsm6dso.h"

#define PART gc_lsm6dso
#define PART_ADDRESS GC_LSM6DSO_ADDRESS                                 /* the address of a single sensor on a bus */
#define PART_ADDRESSES {GC_LSM6DSO_ADDRESS, GC_LSM6DSO_ADDRESS_LOW} /* all that a bus is scanned for, in the order of numbers */

#endif
