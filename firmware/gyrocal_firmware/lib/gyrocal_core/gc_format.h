/* Numbers to text and back without stdio: the same characters on every CPU. */
#ifndef GC_FORMAT_H
#define GC_FORMAT_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GC_FORMAT_MAX 24 /* room that `out` must have; no NUL is added */

/* Writes 9 significant digits, correctly rounded, as printf's "%.9g" does; NaN and infinities give an empty text. Each function
   returns the length. */
size_t gc_format_real(double value, char *out);
size_t gc_format_int(int64_t value, char *out);
size_t gc_format_uint(uint64_t value, char *out);

/* Each reads a number that must fill the whole text; otherwise it returns GC_E_NUMBER. A real is correctly rounded if its digits
   fit 2^53 and its power of ten is within 22, and else within a relative 1e-14. */
int gc_parse_real(const char *text, size_t n, double *value);
int gc_parse_uint(const char *text, size_t n, uint64_t *value);

#ifdef __cplusplus
}
#endif

#endif
