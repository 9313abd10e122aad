/* The reader that comes by radio (gc_remote.h). Tasks of all sensors tell it; Wi-Fi and Bluetooth, which the main loop drives, bring
   it. There is one at a time, whichever way it came. */
#ifndef RADIO_H
#define RADIO_H

#include "gc_remote.h"

/* A line of a command that came, without its end. */
typedef void (*radio_command_t)(const char *line, size_t n);

/* Readers must give this token from now on. Returns false if there is no memory for what waits. */
bool radio_begin(const char *token);
/* Returns n; 0 if there is no room for all n bytes; -1 if there is no reader. Any task may call it. */
int radio_send(const char *data, size_t n);
bool radio_has_reader();
uint32_t radio_refused();

/* Of the main loop: as the functions of gc_remote.h. */
bool radio_connect();
void radio_disconnect();
/* Passes on what came. Returns false if it was not the token: send the note and close the connection. */
bool radio_hear(const char *data, size_t n, radio_command_t command);
bool radio_is_over();
size_t radio_waiting(size_t most, const char **data);
void radio_took(size_t n);

#endif
