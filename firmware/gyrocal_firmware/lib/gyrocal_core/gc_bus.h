/* Transfers between a driver and a die of its part, by I2C or, where the sensor has `spi`, by SPI. Here alone the framing of SPI is
   known. Return GC_OK, GC_E_BUS_NACK or GC_E_BUS_SHORT; on SPI a part that is not there reads as bytes that are all alike. */
#ifndef GC_BUS_H
#define GC_BUS_H

#include "gc_sensor.h"

#ifdef __cplusplus
extern "C" {
#endif

/* n is GC_WRITE_MAX at most. */
int gc_bus_write(const gc_sensor_t *sensor, unsigned die, uint8_t reg, const uint8_t *data, size_t n);
int gc_bus_read(const gc_sensor_t *sensor, unsigned die, uint8_t reg, uint8_t *data, size_t n);

#ifdef __cplusplus
}
#endif

#endif
