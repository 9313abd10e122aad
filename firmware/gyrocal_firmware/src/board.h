/* Pins and options. platformio.ini sets them for each board. */
#ifndef BOARD_H
#define BOARD_H

#if !defined(GYROCAL_SDA) || !defined(GYROCAL_SCL)
#error "say where the sensor is: build_flags = -DGYROCAL_SDA=21 -DGYROCAL_SCL=22"
#endif

/* Options:
 *   GYROCAL_SDA2, GYROCAL_SCL2   a second bus, for sensors three and four (not on the ESP32-C3, which has one)
 *   GYROCAL_INT1                 pin that a sensor's INT1 is wired to, and
 *   GYROCAL_INT1_SENSOR          that sensor's number (0 by default)
 *   GYROCAL_LED                  a plain LED, or
 *   GYROCAL_RGB_LED              an addressable one (WS2812)
 */
#define BAUD 921600

/* The number of a sensor is given by its bus and address. Each bus has two sensors, and the one at 0x6B is the first. */
#define SENSORS_A_BUS 2
#define MAX_SENSORS 4

#if defined(GYROCAL_INT1) && !defined(GYROCAL_INT1_SENSOR)
#define GYROCAL_INT1_SENSOR 0
#endif

#endif
