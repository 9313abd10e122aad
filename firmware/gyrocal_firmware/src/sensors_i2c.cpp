#include "sensors.h"

#if !defined(GYROCAL_SPI_CS)

#include "i2c_bus.h"
#include "output.h"
#include "part.h"
#include "status_led.h"

#include <Arduino.h>

#define TELL_MS 100 /* until what was said is on the wire */

Sensor *sensors[MAX_SENSORS];
static I2cBus *buses[MAX_SENSORS / SENSORS_A_BUS]; /* null if the board does not have it */
static bool stands_in; /* no sensor has answered, and sensor 0 reports it and hears commands */
static const uint8_t places[SENSORS_A_BUS][2] = PLACES;

/* The first address at which the sensor of this number answers; 0 = it does not. */
static uint8_t answering(unsigned imu) {
    I2cBus *bus = buses[imu / SENSORS_A_BUS];
    for (const uint8_t address : places[imu % SENSORS_A_BUS]) {
        if (bus != nullptr && bus->answers(address)) {
            return address;
        }
    }
    return 0;
}

static void add(unsigned imu, uint8_t address) {
    sensors[imu] = new Sensor(buses[imu / SENSORS_A_BUS], address, imu, PIN_INT1(imu));
    status_led_add(imu);
}

static void begin_buses() {
    static I2cBus first(0, Wire, GYROCAL_SDA, GYROCAL_SCL);
    buses[0] = &first;
#if defined(GYROCAL_SDA2) && defined(GYROCAL_SCL2)
    static I2cBus second(1, Wire1, GYROCAL_SDA2, GYROCAL_SCL2);
    buses[1] = &second;
#endif
    for (I2cBus *bus : buses) {
        if (bus != nullptr) {
            bus->begin();
            bus->tell_trouble();
        }
    }
}

static void tell_unused(unsigned imu, uint8_t used) {
    const uint8_t other = places[imu % SENSORS_A_BUS][1];
    if (other != used && buses[imu / SENSORS_A_BUS]->answers(other)) {
        output_say("sensor %u is the one at %02X: the one at %02X of this bus is not used", imu, static_cast<unsigned>(used),
                   static_cast<unsigned>(other));
    }
}

static bool add_those_that_answer() {
    bool any = false;
    for (unsigned imu = 0; imu < MAX_SENSORS; imu++) {
        const uint8_t address = answering(imu);
        if (address != 0) {
            add(imu, address);
            tell_unused(imu, address);
            any = true;
        }
    }
    return any;
}

/* Boards that look alike differ in their pins. */
static void look_at_other_pins() {
    static const struct {
        const char *environment;
        int sda, scl;
    } known[] = KNOWN_PINS;
    for (const auto &pins : known) {
        if (pins.sda == GYROCAL_SDA && pins.scl == GYROCAL_SCL) {
            continue;
        }
        buses[0]->move(pins.sda, pins.scl);
        const bool found = answering(0) != 0 || answering(1) != 0;
        buses[0]->move(GYROCAL_SDA, GYROCAL_SCL);
        if (found) {
            output_say("no sensor answers at SDA %d, SCL %d, but one does at SDA %d, SCL %d: flash -e %s", GYROCAL_SDA,
                       GYROCAL_SCL, pins.sda, pins.scl, pins.environment);
            return;
        }
    }
    output_say("no sensor answers at SDA %d, SCL %d: check its wiring, and that it has 3.3 V", GYROCAL_SDA, GYROCAL_SCL);
}

void sensors_look_again() {
    bool recording = false;
    for (const Sensor *sensor : sensors) {
        recording = recording || (sensor != nullptr && sensor->is_recording());
    }
    stands_in = stands_in && !sensors[0]->is_set_up() && answering(0) != sensors[0]->address();
    for (unsigned imu = 0; imu < MAX_SENSORS && !recording; imu++) {
        const bool is_there = sensors[imu] != nullptr && !(stands_in && imu == 0);
        const uint8_t address = is_there ? 0 : answering(imu);
        if (address == 0) {
            continue;
        }
        if (stands_in) { /* there is no sensor 0, and nothing was recorded */
            output_say("sensor %u answers now: the board restarts", imu);
            delay(TELL_MS);
            ESP.restart();
        }
        add(imu, address);
        sensors[imu]->start();
    }
}

void sensors_find() {
    begin_buses();
    stands_in = !add_those_that_answer();
    if (stands_in) {
        look_at_other_pins();
        add(0, places[0][0]);
    }
}

#endif
