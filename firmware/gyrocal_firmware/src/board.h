/* Pins and options. platformio.ini sets them for each board. */
#ifndef BOARD_H
#define BOARD_H

#include <sdkconfig.h>

#if !defined(GYROCAL_SPI_CS) && (!defined(GYROCAL_SDA) || !defined(GYROCAL_SCL))
#error "say where the sensor is: build_flags = -DGYROCAL_SDA=21 -DGYROCAL_SCL=22"
#endif
#if defined(GYROCAL_SPI_CS) && (!defined(GYROCAL_SPI_SCK) || !defined(GYROCAL_SPI_MISO) || !defined(GYROCAL_SPI_MOSI))
#error "say where the sensor is: build_flags = -DGYROCAL_SPI_SCK=18 -DGYROCAL_SPI_MISO=19 -DGYROCAL_SPI_MOSI=23 -DGYROCAL_SPI_CS=5"
#endif

/* Options:
 *   GYROCAL_SDA2, GYROCAL_SCL2   a second bus, for sensors three and four (not on the ESP32-C3, which has one)
 *   GYROCAL_SPI_CS               a sensor by SPI, number 0, and none by I2C: its chip select, with
 *   GYROCAL_SPI_SCK, GYROCAL_SPI_MISO, GYROCAL_SPI_MOSI
 *   GYROCAL_SPI_CS2              chip select of a second die, where the sensor has one (docs/first-hour.md)
 *   GYROCAL_SPI_HZ               the fastest clock of SPI; slower where the wires are long
 *   GYROCAL_INT1                 pin that a sensor's INT1 is wired to, and
 *   GYROCAL_INT1_SENSOR          that sensor's number (0 by default)
 *   GYROCAL_LED                  a plain LED, or
 *   GYROCAL_RGB_LED              an addressable one (WS2812)
 *   GYROCAL_BLE                  Bluetooth Low Energy too (ble.h)
 *   GYROCAL_I2C_HZ               clock of the buses; slower where the cables are long
 */
#if !defined(GYROCAL_I2C_HZ)
#define GYROCAL_I2C_HZ 400000
#endif

#if !defined(GYROCAL_SPI_CS2)
#define GYROCAL_SPI_CS2 -1
#endif
#if !defined(GYROCAL_SPI_HZ)
#define GYROCAL_SPI_HZ 8000000
#endif

#define BAUD 921600

/* The number of a sensor is given by its bus and its place there (part.h). */
#define SENSORS_A_BUS 2
#define MAX_SENSORS 4

/* The environments of platformio.ini for this chip, and their pins. Where no sensor answers, the others' pins are tried. */
#if defined(CONFIG_IDF_TARGET_ESP32)
#define KNOWN_PINS {{"thing_plus_micro_b", 23, 22}, {"thing_plus_usb_c", 21, 22}}
#elif defined(CONFIG_IDF_TARGET_ESP32C3)
#define KNOWN_PINS {{"esp32_c3", 4, 5}}
#else
#define KNOWN_PINS {{"esp32_s3", 8, 9}}
#endif

#if !defined(GYROCAL_INT1)
#define GYROCAL_INT1 -1
#endif
#if !defined(GYROCAL_INT1_SENSOR)
#define GYROCAL_INT1_SENSOR 0
#endif
/* The pin that the INT1 of a sensor is wired to, or -1. */
#define PIN_INT1(imu) ((imu) == GYROCAL_INT1_SENSOR ? GYROCAL_INT1 : -1)

#endif
