/* Any bytes into parser, line reader and number parser: no crash, and what was accepted is well formed.
   Standalone: random mutations of sentences. For libFuzzer: clang -fsanitize=fuzzer -DGC_LIBFUZZER. */
#include "gc_error.h"
#include "gc_format.h"
#include "gc_wire.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);

static void must(int condition, const char *what) {
    if (!condition) {
        fprintf(stderr, "fuzz_wire: %s\n", what);
        abort();
    }
}

static int accept(const char *line, size_t n) {
    gc_message_t m;
    char *copy = malloc(n + 1);
    memcpy(copy, line, n);
    const int error = gc_wire_parse(copy, n, &m);
    if (error == GC_OK) {
        must(strlen(m.tag) == 3 && m.n_fields <= GC_WIRE_MAX_FIELDS, "malformed message accepted");
        for (unsigned i = 0; i < m.n_fields; i++) {
            const gc_field_t *f = &m.field[i];
            must(f->value.text >= copy && f->value.text + f->value.n <= copy + n, "field outside the line");
            must(memchr(f->value.text, ',', f->value.n) == NULL, "field holds a comma");
        }
    } else {
        must(strcmp(gc_error_name(error), "unknown") != 0, "error without a name");
    }
    free(copy);
    return error;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n) {
    char buffer[GC_WIRE_MAX];
    gc_line_reader_t reader;
    gc_line_reader_init(&reader, buffer, sizeof buffer);
    (void)accept((const char *)data, n);
    for (size_t i = 0; i < n; i++) {
        const int got = gc_line_push(&reader, (char)data[i]);
        must(got == 0 || got == 1 || got == GC_E_LINE_TOO_LONG, "line reader's result");
        must(reader.n <= sizeof buffer, "line longer than its buffer");
        if (got == 1) {
            (void)accept(reader.line, reader.n);
        }
    }
    double value;
    if (gc_parse_real((const char *)data, n, &value) == GC_OK) {
        char text[GC_FORMAT_MAX];
        double again = 0.0;
        must(value - value == 0.0, "a number that is none");
        const size_t length = gc_format_real(value, text);
        must(length <= GC_FORMAT_MAX && gc_parse_real(text, length, &again) == GC_OK, "number does not come back");
        must(again - value <= 1e-8 * (value < 0 ? -value : value) + 1e-300, "number changed");
    }
    return 0;
}

#ifndef GC_LIBFUZZER
static uint64_t state = 88172645463325252u;

static uint32_t any(uint32_t below) {
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return (uint32_t)(state >> 33) % below;
}

static unsigned count_commas(const char *text, size_t n) {
    unsigned commas = 0;
    for (size_t i = 0; i < n; i++) {
        commas += text[i] == ',';
    }
    return commas;
}

int main(int argc, char **argv) {
    const long rounds = argc > 1 ? atol(argv[1]) : 100000;
    long accepted = 0;
    for (long k = 0; k < rounds; k++) {
        gc_sentence_t s;
        gc_sentence_begin(&s, "RAW", any(UINT32_MAX), state, any(256));
        for (uint32_t i = any(30); i > 0; i--) {
            if (any(2)) {
                gc_sentence_int(&s, any(2) ? NULL : "n", (int64_t)state);
            } else {
                gc_sentence_real(&s, "r", (double)(int32_t)any(UINT32_MAX) * 1e-5);
            }
        }
        int n = gc_sentence_end(&s);
        if (n < 0) {
            n = (int)any(GC_WIRE_MAX);
        } else if (accept(s.text, (size_t)n) != GC_OK) {
            must(count_commas(s.text, (size_t)n) > 3u + GC_WIRE_MAX_FIELDS, "own sentence refused");
        }
        const uint32_t changes = any(4);
        for (uint32_t i = 0; i < changes && n > 0; i++) {
            switch (any(4)) {
            case 0: s.text[any((uint32_t)n)] = (char)any(256); break;
            case 1: s.text[any((uint32_t)n)] ^= (char)(1u << any(8)); break;
            case 2: n = (int)any((uint32_t)n + 1u); break;
            default: s.text[any((uint32_t)n)] = ",*$=\n\r.-e"[any(9)]; break;
            }
        }
        accepted += accept(s.text, (size_t)n) == GC_OK;
        (void)LLVMFuzzerTestOneInput((const uint8_t *)s.text, (size_t)n);
        (void)LLVMFuzzerTestOneInput((const uint8_t *)s.text + 4, n > 12 ? any(12) : 0u);
    }
    printf("%ld of %ld accepted\n", accepted, rounds);
    return 0;
}
#endif
