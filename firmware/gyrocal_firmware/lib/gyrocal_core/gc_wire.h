/* Sentences of PROTOCOL.md, written and read in the caller's memory. */
#ifndef GC_WIRE_H
#define GC_WIRE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GC_WIRE_PROTOCOL 1
#define GC_WIRE_MAX 320 /* bytes of a line, line end included */
#define GC_WIRE_MAX_FIELDS 24

/* Whether a line or a frame (gc_pack.h) is one of samples, which a stream sends; the others answer commands or tell of runs. */
bool gc_wire_is_sample(const char *line, size_t n);

/* CRC-16/CCITT-FALSE. */
uint16_t gc_wire_crc(const char *data, size_t n);

typedef struct {
    char text[GC_WIRE_MAX];
    size_t n;
    bool overflow;
} gc_sentence_t;

void gc_sentence_begin(gc_sentence_t *s, const char tag[3], uint32_t seq, uint64_t t_us, unsigned imu);
/* As gc_sentence_text, but the text is cut so that `reserve` bytes stay free for what follows. */
void gc_sentence_text_cut(gc_sentence_t *s, const char *name, const char *text, size_t reserve);
/* name NULL: a positional field. Characters that the wire reserves become '_'; text NULL becomes empty. */
void gc_sentence_text(gc_sentence_t *s, const char *name, const char *text);
void gc_sentence_int(gc_sentence_t *s, const char *name, int64_t value);
void gc_sentence_uint(gc_sentence_t *s, const char *name, uint64_t value);
void gc_sentence_real(gc_sentence_t *s, const char *name, double value);
/* Adds CRC and line end. Returns the length, or GC_E_WIRE_TOO_LONG. */
int gc_sentence_end(gc_sentence_t *s);

typedef struct {
    const char *text; /* not NUL-terminated */
    size_t n;
} gc_text_t;

typedef struct {
    gc_text_t name; /* empty for a positional field */
    gc_text_t value;
} gc_field_t;

typedef struct {
    char tag[4];
    uint32_t seq;
    uint64_t t_us;
    unsigned imu;
    unsigned n_fields;
    gc_field_t field[GC_WIRE_MAX_FIELDS];
} gc_message_t;

/* Reads one line, with or without its line end. The message points into the line. Returns GC_OK or an error of the wire. */
int gc_wire_parse(const char *line, size_t n, gc_message_t *message);
/* Returns the value of the named field, or NULL. */
const gc_text_t *gc_message_field(const gc_message_t *message, const char *name);
bool gc_text_equals(gc_text_t text, const char *other);

/* Collects bytes into lines of at most `capacity`, each ended by CR, LF or both; a longer one is skipped to its end. */
typedef struct {
    char *line;
    size_t capacity;
    size_t n;
    bool skipping;
    bool complete;
    bool after_cr; /* a line feed that follows belongs to it */
} gc_line_reader_t;

void gc_line_reader_init(gc_line_reader_t *reader, char *buffer, size_t capacity);
/* Returns 1 if reader->line holds a line of reader->n bytes (no line end), which is valid until the next push; 0 if not yet; or
   GC_E_LINE_TOO_LONG, once, at the end of a line that was skipped. */
int gc_line_push(gc_line_reader_t *reader, char byte);
/* The same for a line that is passed on: one that is too long is cut to the capacity. Returns whether there is a line. */
bool gc_line_push_cut(gc_line_reader_t *reader, char byte);

#ifdef __cplusplus
}
#endif

#endif
