/* A sensor by SPI at the pins of board.h: one, so that nobody else has the bus. */
#ifndef SPI_BUS_H
#define SPI_BUS_H

#include "gc_port.h"

class SpiBus {
public:
    static void begin();
    /* As gc_port.h says. */
    static int transfer(unsigned die, const gc_spi_t &how, const uint8_t *out, size_t n_out, uint8_t *in, size_t n_in);
};

#endif
