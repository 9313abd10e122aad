#include "gc_wire.h"

#include "gc_error.h"
#include "gc_format.h"

#include <string.h>

#define TAIL 6 /* *CRC and line end */

bool gc_wire_is_sample(const char *line, size_t n) {
    return n > 4u && (line[0] == '>' || line[0] == '\0' || memcmp(line, "$RAW", 4) == 0 || memcmp(line, "$GYR", 4) == 0);
}

uint16_t gc_wire_crc(const char *data, size_t n) {
    uint32_t crc = 0xFFFFu;
    for (size_t i = 0; i < n; i++) { /* the polynomial 0x1021 a byte at a time, without a table */
        uint32_t x = (crc >> 8) ^ (uint8_t)data[i];
        x ^= x >> 4;
        crc = ((crc << 8) ^ (x << 12) ^ (x << 5) ^ x) & 0xFFFFu;
    }
    return (uint16_t)crc;
}

static void put(gc_sentence_t *s, const char *data, size_t n) {
    if (s->overflow || n > GC_WIRE_MAX - TAIL - s->n) {
        s->overflow = true;
        return;
    }
    memcpy(s->text + s->n, data, n);
    s->n += n;
}

static void put_name(gc_sentence_t *s, const char *name) {
    put(s, ",", 1);
    if (name != NULL) {
        put(s, name, strlen(name));
        put(s, "=", 1);
    }
}

static void put_text(gc_sentence_t *s, const char *text, size_t n) {
    for (size_t i = 0; i < n; i++) {
        const bool reserved = text[i] <= ' ' || text[i] > '~' || strchr(",*$=", text[i]) != NULL;
        put(s, reserved ? "_" : text + i, 1);
    }
}

void gc_sentence_text(gc_sentence_t *s, const char *name, const char *text) {
    put_name(s, name);
    put_text(s, text, text != NULL ? strlen(text) : 0u);
}

void gc_sentence_text_cut(gc_sentence_t *s, const char *name, const char *text, size_t reserve) {
    put_name(s, name);
    const size_t taken = s->n + reserve;
    const size_t room = taken < GC_WIRE_MAX - TAIL ? GC_WIRE_MAX - TAIL - taken : 0u;
    const size_t n = text != NULL ? strlen(text) : 0u;
    put_text(s, text, n < room ? n : room);
}

void gc_sentence_int(gc_sentence_t *s, const char *name, int64_t value) {
    char text[GC_FORMAT_MAX];
    put_name(s, name);
    put(s, text, gc_format_int(value, text));
}

void gc_sentence_uint(gc_sentence_t *s, const char *name, uint64_t value) {
    char text[GC_FORMAT_MAX];
    put_name(s, name);
    put(s, text, gc_format_uint(value, text));
}

void gc_sentence_real(gc_sentence_t *s, const char *name, double value) {
    char text[GC_FORMAT_MAX];
    put_name(s, name);
    put(s, text, gc_format_real(value, text));
}

void gc_sentence_begin(gc_sentence_t *s, const char tag[3], uint32_t seq, uint64_t t_us, unsigned imu) {
    s->n = 0;
    s->overflow = false;
    put(s, "$", 1);
    put(s, tag, 3);
    gc_sentence_uint(s, NULL, seq);
    gc_sentence_uint(s, NULL, t_us);
    gc_sentence_uint(s, NULL, imu);
}

int gc_sentence_end(gc_sentence_t *s) {
    if (s->overflow) {
        return GC_E_WIRE_TOO_LONG;
    }
    const unsigned crc = gc_wire_crc(s->text + 1, s->n - 1u);
    s->text[s->n++] = '*';
    for (unsigned shift = 16; shift > 0u; shift -= 4u) {
        s->text[s->n++] = "0123456789ABCDEF"[crc >> (shift - 4u) & 0xFu];
    }
    s->text[s->n++] = '\n';
    return (int)s->n;
}

static int hex_digit(char c) {
    if (c >= '0' && c <= '9') {
        return c - '0';
    }
    return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

/* Cuts the text before the next comma off the front of rest; false when there was none left. */
static bool next_field(gc_text_t *rest, gc_text_t *field) {
    if (rest->text == NULL) {
        return false;
    }
    field->text = rest->text;
    const char *comma = memchr(rest->text, ',', rest->n);
    if (comma == NULL) {
        field->n = rest->n;
        rest->text = NULL;
        return true;
    }
    field->n = (size_t)(comma - rest->text);
    rest->text = comma + 1;
    rest->n -= field->n + 1u;
    return true;
}

static bool next_uint(gc_text_t *rest, uint64_t max, uint64_t *value) {
    gc_text_t field;
    return next_field(rest, &field) && gc_parse_uint(field.text, field.n, value) == GC_OK && *value <= max;
}

int gc_wire_parse(const char *line, size_t n, gc_message_t *message) {
    if (n > GC_WIRE_MAX) {
        return GC_E_WIRE_TOO_LONG;
    }
    if (n > 0u && line[n - 1u] == '\n') {
        n--;
    }
    if (n > 0u && line[n - 1u] == '\r') {
        n--;
    }
    if (n == 0u || line[0] != '$') {
        return GC_E_WIRE_START;
    }
    if (n < 6u || line[n - 5u] != '*') {
        return GC_E_WIRE_SYNTAX;
    }
    unsigned crc = 0;
    for (size_t i = n - 4u; i < n; i++) {
        const int digit = hex_digit(line[i]);
        if (digit < 0) {
            return GC_E_WIRE_SYNTAX;
        }
        crc = crc << 4 | (unsigned)digit;
    }
    gc_text_t rest = {line + 1, n - 6u};
    if (crc != gc_wire_crc(rest.text, rest.n)) {
        return GC_E_WIRE_CRC;
    }

    gc_text_t field;
    uint64_t seq;
    uint64_t imu;
    if (!next_field(&rest, &field) || field.n != 3u) {
        return GC_E_WIRE_SYNTAX;
    }
    for (size_t i = 0; i < 3u; i++) {
        if (field.text[i] < 'A' || field.text[i] > 'Z') {
            return GC_E_WIRE_SYNTAX;
        }
        message->tag[i] = field.text[i];
    }
    message->tag[3] = '\0';
    if (!next_uint(&rest, UINT32_MAX, &seq) || !next_uint(&rest, UINT64_MAX, &message->t_us) || !next_uint(&rest, 255u, &imu)) {
        return GC_E_WIRE_SYNTAX;
    }
    message->seq = (uint32_t)seq;
    message->imu = (unsigned)imu;
    message->n_fields = 0;
    while (next_field(&rest, &field)) {
        if (message->n_fields == GC_WIRE_MAX_FIELDS) {
            return GC_E_WIRE_SYNTAX;
        }
        gc_field_t *f = &message->field[message->n_fields++];
        const char *equals = field.n > 0u ? memchr(field.text, '=', field.n) : NULL;
        f->name.text = field.text;
        f->name.n = equals != NULL ? (size_t)(equals - field.text) : 0u;
        f->value.text = equals != NULL ? equals + 1 : field.text;
        f->value.n = equals != NULL ? field.n - f->name.n - 1u : field.n;
    }
    return GC_OK;
}

bool gc_text_equals(gc_text_t text, const char *other) {
    return strlen(other) == text.n && memcmp(text.text, other, text.n) == 0;
}

const gc_text_t *gc_message_field(const gc_message_t *message, const char *name) {
    for (unsigned i = 0; i < message->n_fields; i++) {
        if (message->field[i].name.n > 0u && gc_text_equals(message->field[i].name, name)) {
            return &message->field[i].value;
        }
    }
    return NULL;
}

void gc_line_reader_init(gc_line_reader_t *reader, char *buffer, size_t capacity) {
    reader->line = buffer;
    reader->capacity = capacity;
    reader->n = 0;
    reader->skipping = false;
    reader->complete = false;
    reader->after_cr = false;
}

int gc_line_push(gc_line_reader_t *reader, char byte) {
    if (reader->complete) {
        reader->complete = false;
        reader->n = 0;
    }
    const bool second = byte == '\n' && reader->after_cr;
    reader->after_cr = byte == '\r';
    if (second) {
        return 0;
    }
    if (byte == '\n' || byte == '\r') {
        const bool skipped = reader->skipping;
        reader->skipping = false;
        if (skipped) {
            reader->n = 0;
            return GC_E_LINE_TOO_LONG;
        }
        reader->complete = true;
        return 1;
    }
    if (reader->n == reader->capacity) {
        reader->skipping = true;
    }
    if (!reader->skipping) {
        reader->line[reader->n++] = byte;
    }
    return 0;
}

bool gc_line_push_cut(gc_line_reader_t *reader, char byte) {
    const int got = gc_line_push(reader, byte);
    if (got < 0) {
        reader->n = reader->capacity;
        reader->complete = true;
    }
    return got != 0;
}
