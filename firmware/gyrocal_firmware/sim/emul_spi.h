/* An emulated part as seen from SPI, written apart from the core's framing, so that each checks the other. Strict: a transfer in a mode
   or at a clock that its maker does not allow, to a die that it does not have, or whose bytes make no sense is a fault, and does
   nothing. Nothing tells the core of it: where nothing drives the line, it reads ones. */
#ifndef EMUL_SPI_H
#define EMUL_SPI_H

#include "emul.h"

/* One transfer: the chip select of a die goes low, n_out bytes are sent, n_in received, and it rises. */
void emul_spi(emul_t *emul, uint64_t now_us, unsigned die, unsigned mode, uint32_t hz, const uint8_t *out, size_t n_out, uint8_t *in,
              size_t n_in);

#endif
