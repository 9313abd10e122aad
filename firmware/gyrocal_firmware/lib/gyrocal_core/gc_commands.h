/* Commands are lines of plain words, and each is answered by $ACK or $ERR. PROTOCOL.md lists them. */
#ifndef GC_COMMANDS_H
#define GC_COMMANDS_H

#include "gc_wire.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GC_COMMAND_MAX 80

struct gc_device;

typedef struct {
    gc_line_reader_t reader;
    char line[GC_COMMAND_MAX + 1];
} gc_commands_t;

void gc_commands_init(gc_commands_t *commands);
/* Takes the next byte, and executes the command that it completes. */
void gc_commands_hear(struct gc_device *device, char byte);

#ifdef __cplusplus
}
#endif

#endif
