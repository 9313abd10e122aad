/* The sensors that the firmware knows, and the addresses at which it looks for them. To build for fewer, list those of their drivers
   that remain, as gc_parts.c does. */
#ifndef PART_H
#define PART_H

#include "gc_parts.h"

#define PARTS gc_parts
/* A bus has two places for sensors, and a place two addresses: the sensor there is the one that answers first. */
#define PLACES {{0x6B, 0x68}, {0x6A, 0x69}}

#endif
