/* Sentences and commands by Bluetooth Low Energy, as the Nordic UART Service. It is in the firmware with -DGYROCAL_BLE alone, and wants
   the token that `wifi token` has set: without one it is not on the air. */
#ifndef BLE_PORT_H
#define BLE_PORT_H

#include "radio.h"

#if defined(GYROCAL_BLE)
/* Of the main loop: offers, serves, passes commands on. */
void ble_step(radio_command_t command);
#else
inline void ble_step(radio_command_t) {
}
#endif

#endif
