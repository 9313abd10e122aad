#include "gc_bus.h"

#include "gc_error.h"

#include <string.h>

#define READS 0x80u /* in the first byte */
#define MOST_DUMMIES 1u

static uint8_t address_of(const gc_sensor_t *sensor, unsigned die) {
    return die == 0u ? sensor->address : sensor->other_address;
}

int gc_bus_write(const gc_sensor_t *sensor, unsigned die, uint8_t reg, const uint8_t *data, size_t n) {
    const gc_port_t *port = sensor->port;
    uint8_t out[1u + GC_WRITE_MAX];
    if (sensor->spi[die] == NULL) {
        return port->bus_write(port->context, address_of(sensor, die), reg, data, n) < 0 ? GC_E_BUS_NACK : GC_OK;
    }
    out[0] = reg;
    memcpy(out + 1, data, n);
    return port->spi(port->context, die, sensor->spi[die], out, 1u + n, NULL, 0) < 0 ? GC_E_BUS_NACK : GC_OK;
}

int gc_bus_read(const gc_sensor_t *sensor, unsigned die, uint8_t reg, uint8_t *data, size_t n) {
    const gc_port_t *port = sensor->port;
    const gc_spi_t *spi = sensor->spi[die];
    if (spi == NULL) {
        const int got = port->bus_read(port->context, address_of(sensor, die), reg, data, n);
        return got < 0 ? GC_E_BUS_NACK : (size_t)got == n ? GC_OK : GC_E_BUS_SHORT;
    }
    const uint8_t out[1u + MOST_DUMMIES] = {(uint8_t)(reg | READS), 0};
    return port->spi(port->context, die, spi, out, 1u + spi->dummies, data, n) < 0 ? GC_E_BUS_NACK : GC_OK;
}
