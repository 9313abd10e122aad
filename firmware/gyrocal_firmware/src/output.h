/* Whole sentences, from any task, to the serial port, by a task of its own: who speaks never waits. */
#ifndef OUTPUT_H
#define OUTPUT_H

#include <stddef.h>

void output_begin();
/* n, or 0 where there is no room for all of it: then nothing of it is sent. */
int output_send(const char *data, size_t n);
/* A line for people, as printf. */
void output_say(const char *format, ...) __attribute__((format(printf, 1, 2)));

#endif
