/* Sends whole sentences from any task to the serial port, and to a reader by radio if there is one. Others write them, so that callers
   never wait. */
#ifndef OUTPUT_H
#define OUTPUT_H

#include <stddef.h>

void output_begin();
/* Returns n, or 0 if there is no room for all n bytes. Then nothing is sent. */
int output_send(const char *data, size_t n);
/* Sends a line of text for people. The arguments are those of printf. */
void output_say(const char *format, ...) __attribute__((format(printf, 1, 2)));

#endif
