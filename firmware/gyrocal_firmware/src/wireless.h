/* Sentences and commands by TCP in a wireless network, which the command `wifi` names (gc_wifi.h). Off until it is switched on. */
#ifndef WIRELESS_H
#define WIRELESS_H

#include "gc_port.h"
#include "radio.h"

/* Reads what is kept in flash. */
void wifi_begin();
/* Of the main loop: joins, serves, passes commands on; never waits for the network. */
void wifi_step(radio_command_t command);
/* Of the main loop: the token that is kept, empty if there is none; the name of this board, which no other one has. */
const char *wifi_token();
const char *wifi_host();

/* The callbacks `wifi` and `wifi_state` of gc_port.h. Any task may call them. */
int wifi_obey(void *context, gc_wifi_word_t word, const char *text, size_t n);
void wifi_state(void *context, gc_wifi_state_t *state);

#endif
