/* What the fuzz targets share: bytes of the input taken in order, and a check that ends the program. */
#ifndef FUZZ_H
#define FUZZ_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);

typedef struct {
    const uint8_t *data;
    size_t n, taken;
} fuzz_input_t;

static inline void fuzz_must(int condition, const char *what) {
    if (!condition) {
        fprintf(stderr, "fuzz: %s\n", what);
        abort();
    }
}

/* Copies the next `size` bytes of the input; zeros where it has ended. */
static inline void fuzz_take(fuzz_input_t *input, void *out, size_t size) {
    const size_t left = input->n - input->taken;
    const size_t taken = size < left ? size : left;
    memset(out, 0, size);
    memcpy(out, input->data + input->taken, taken);
    input->taken += taken;
}

static inline uint8_t fuzz_byte(fuzz_input_t *input) {
    uint8_t byte;
    fuzz_take(input, &byte, 1);
    return byte;
}

/* A number of ordinary size, or one time in eight any bits at all: infinite, not a number, subnormal. */
static inline double fuzz_real(fuzz_input_t *input, double size) {
    const uint8_t kind = fuzz_byte(input);
    double any;
    int16_t ordinary;
    if (kind % 8u == 7u) {
        fuzz_take(input, &any, sizeof any);
        return any;
    }
    fuzz_take(input, &ordinary, sizeof ordinary);
    return size * (double)ordinary / 32768.0;
}

#ifndef GC_LIBFUZZER
/* Without libFuzzer: inputs of pseudorandom bytes, as many as the first argument says. */
int main(int argc, char **argv) {
    const long rounds = argc > 1 ? atol(argv[1]) : 1000;
    uint64_t state = 88172645463325252u;
    for (long k = 0; k < rounds; k++) {
        uint8_t data[2048];
        for (size_t i = 0; i < sizeof data; i++) {
            state = state * 6364136223846793005u + 1442695040888963407u;
            data[i] = (uint8_t)(state >> 56);
        }
        (void)LLVMFuzzerTestOneInput(data, sizeof data);
    }
    return 0;
}
#endif

#endif
