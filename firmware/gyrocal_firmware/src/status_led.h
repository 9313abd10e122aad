/* One light for all sensors; docs/board.md lists its signals. */
#ifndef STATUS_LED_H
#define STATUS_LED_H

#include "gc_port.h"

void status_led_begin();
void status_led_add(unsigned imu);
void status_led_set(unsigned imu, gc_led_t state);
/* To be called every few milliseconds. */
void status_led_show();

#endif
