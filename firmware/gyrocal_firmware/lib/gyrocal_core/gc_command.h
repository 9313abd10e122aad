/* A command is a line of plain words. Here it becomes a value, and gc_device.c carries it out. PROTOCOL.md lists the commands. */
#ifndef GC_COMMAND_H
#define GC_COMMAND_H

#include "gc_settings.h"
#include "gc_stream.h"
#include "gc_wire.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GC_COMMAND_MAX 80 /* bytes of a line, without its end */

typedef enum {
    GC_COMMAND_NONE, /* a line that is empty or names no command */
    GC_COMMAND_HELLO,
    GC_COMMAND_STATUS,
    GC_COMMAND_START,
    GC_COMMAND_AUTO,
    GC_COMMAND_STOP,
    GC_COMMAND_STREAM,
    GC_COMMAND_SET,
    GC_COMMAND_GET,
    GC_COMMAND_RESET,
    GC_COMMAND_DUMP,
    GC_COMMAND_UNDO,
    GC_COMMAND_SELFTEST,
    GC_COMMAND_REBOOT,
    GC_COMMAND_WIFI,
    GC_COMMANDS
} gc_command_kind_t;

typedef struct {
    gc_command_kind_t kind;
    int error;            /* GC_OK, or what is wrong with the words: GC_E_COMMAND or GC_E_ARGUMENT */
    int face;             /* start: +1 up, -1 down */
    gc_stream_t stream;   /* stream */
    gc_setting_t setting; /* auto, set, get */
    gc_wifi_word_t wifi;  /* wifi */
    gc_text_t value;      /* auto, set: the word for the setting, in the line that was read; wifi: the rest of the line */
} gc_command_t;

/* Reads a line without its end. */
gc_command_t gc_command_read(const char *line, size_t n);
const char *gc_command_name(gc_command_kind_t kind);

#ifdef __cplusplus
}
#endif

#endif
