/* The sensors of the board: up to two on each of two I2C buses, or one by SPI where GYROCAL_SPI_CS says so. */
#ifndef SENSORS_H
#define SENSORS_H

#include "board.h"
#include "sensor.h"

extern Sensor *sensors[MAX_SENSORS]; /* by number; null if no sensor has answered */

/* Begins the buses and makes the sensors that answer, or one that reports that none does. */
void sensors_find();
/* Takes up a sensor that was connected later, but not during a run, whose samples would be late. */
void sensors_look_again();

#endif
