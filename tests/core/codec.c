/* The wire's codec as a filter: a job a line on stdin, its result a line on stdout.
 *
 *     parse LINE     ok TAG SEQ T_US IMU then NAME<US>VALUE for each field, separated by <RS>; or the error's name
 *     crc TEXT       four hex digits
 *     real HEX       a double's bits as text
 *     number TEXT    the bits of the double that a text means, or the error's name
 *     int TEXT       an int64 as text
 */
#include "gc_error.h"
#include "gc_format.h"
#include "gc_wire.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void parse(const char *line, size_t n) {
    gc_message_t m;
    char *copy = malloc(n + 1); /* a buffer of its own: reading past its end is seen */
    memcpy(copy, line, n);
    const int error = gc_wire_parse(copy, n, &m);
    if (error != GC_OK) {
        printf("%s\n", gc_error_name(error));
    } else {
        printf("ok %s %" PRIu32 " %" PRIu64 " %u", m.tag, m.seq, m.t_us, m.imu);
        for (unsigned i = 0; i < m.n_fields; i++) {
            printf("\x1e%.*s\x1f%.*s", (int)m.field[i].name.n, m.field[i].name.text, (int)m.field[i].value.n, m.field[i].value.text);
        }
        printf("\n");
    }
    free(copy);
}

int main(void) {
    static char line[8192];
    while (fgets(line, sizeof line, stdin) != NULL) {
        size_t n = strlen(line);
        line[--n] = '\0';
        char out[GC_FORMAT_MAX];
        char *rest = strchr(line, ' ');
        if (rest == NULL) {
            return 2;
        }
        rest++;
        n -= (size_t)(rest - line);
        if (strncmp(line, "parse ", 6) == 0) {
            parse(rest, n);
        } else if (strncmp(line, "crc ", 4) == 0) {
            printf("%04X\n", (unsigned)gc_wire_crc(rest, n));
        } else if (strncmp(line, "real ", 5) == 0) {
            const uint64_t bits = strtoull(rest, NULL, 16);
            double value;
            memcpy(&value, &bits, sizeof value);
            printf("%.*s\n", (int)gc_format_real(value, out), out);
        } else if (strncmp(line, "int ", 4) == 0) {
            printf("%.*s\n", (int)gc_format_int(strtoll(rest, NULL, 10), out), out);
        } else {
            double value;
            uint64_t bits;
            const int error = gc_parse_real(rest, n, &value);
            memcpy(&bits, &value, sizeof bits);
            if (error != GC_OK) {
                printf("%s\n", gc_error_name(error));
            } else {
                printf("%016" PRIx64 "\n", bits);
            }
        }
    }
    return 0;
}
