#include "emul_spi.h"

#include <string.h>

#define READS 0x80u
#define LONGEST 512u
#define BOSCH_RESET_REG 0x7E
#define BOSCH_RESET 0xB6

static void write_to(emul_t *emul, uint64_t now_us, unsigned die, bool asked_for, const uint8_t *out, size_t n_out) {
    const int taken = emul_write_die(emul, now_us, die, out[0], out + 1, n_out - 1u);
    if (taken >= 0 && asked_for && out[0] == BOSCH_RESET_REG && out[1] == BOSCH_RESET) {
        emul->speaks_spi[die] = false;
    }
}

/* All bytes behind the first one and the dummies are registers, whether anybody listens to them or not. */
static void read_from(emul_t *emul, uint64_t now_us, unsigned die, size_t dummies, uint8_t reg, size_t unheard, uint8_t *in, size_t n_in) {
    uint8_t bytes[LONGEST];
    const size_t n = unheard + n_in;
    memset(bytes, 0xA5, dummies < n ? dummies : n);
    if (n > dummies && emul_read_die(emul, now_us, die, reg, bytes + dummies, n - dummies) < 0) {
        return;
    }
    memcpy(in, bytes + unheard, n_in);
}

void emul_spi(emul_t *emul, uint64_t now_us, unsigned die, unsigned mode, uint32_t hz, const uint8_t *out, size_t n_out, uint8_t *in,
              size_t n_in) {
    const emul_spi_t *facts = emul->kind->spi;
    const bool reads = n_out > 0 && (out[0] & READS) != 0;
    const bool whole = reads ? n_in > 0 && n_out + n_in < LONGEST : n_out > 1 && n_in == 0;
    uint8_t nothing[1];
    if (n_in > 0) {
        memset(in, 0xFF, n_in);
    }
    if (!whole || facts == NULL || die >= facts->dies || hz > facts->most_hz || (mode != 0 && mode != 3)) {
        emul->spi_faults++;
        return;
    }
    if (facts->asked_for[die] && !emul->speaks_spi[die]) {
        emul->speaks_spi[die] = emul_read_die(emul, now_us, die, 0, nothing, 0) >= 0; /* not before it has started */
        return;
    }
    if (reads) {
        read_from(emul, now_us, die, facts->dummies[die], out[0] & 0x7Fu, n_out - 1u, in, n_in);
    } else {
        write_to(emul, now_us, die, facts->asked_for[die], out, n_out);
    }
}
