/* Where things are connected; platformio.ini says it for each board. */
#ifndef BOARD_H
#define BOARD_H

#if !defined(GYROCAL_SDA) || !defined(GYROCAL_SCL)
#error "say where the sensor is: build_flags = -DGYROCAL_SDA=21 -DGYROCAL_SCL=22"
#endif

/* Options:
 *   GYROCAL_SDA2, GYROCAL_SCL2   a second bus, for sensors three and four (not on the ESP32-C3, which has one)
 *   GYROCAL_INT1                 pin that the first sensor's INT1 is wired to
 *   GYROCAL_LED                  a plain LED, or
 *   GYROCAL_RGB_LED              an addressable one (WS2812)
 */
#define BAUD 921600
#define MAX_SENSORS 4

#endif
