/* The ESP32's port of the core: finds the sensors, gives each a task, passes commands on and shows the light. */
#include "board.h"
#include "i2c_bus.h"
#include "output.h"
#include "part.h"
#include "sensor.h"
#include "status_led.h"

#include <Arduino.h>
#include <esp_task_wdt.h>

#define WATCHDOG_S 5
#define BOOT_MS 20 /* the sensors' own */
#define IDLE_MS 4

static Sensor *sensors[MAX_SENSORS]; /* by their number; null where none answered */
static const uint8_t addresses[SENSORS_A_BUS] = PART_ADDRESSES;

static void add(I2cBus &bus, unsigned which) {
    const unsigned imu = SENSORS_A_BUS * bus.number() + which;
#if defined(GYROCAL_INT1)
    const int pin_int1 = imu == GYROCAL_INT1_SENSOR ? GYROCAL_INT1 : -1;
#else
    const int pin_int1 = -1;
#endif
    sensors[imu] = new Sensor(bus, addresses[which], imu, pin_int1);
    status_led_add(imu);
}

static unsigned add_those_that_answer(I2cBus &bus) {
    unsigned found = 0;
    bus.begin();
    for (unsigned which = 0; which < SENSORS_A_BUS; which++) {
        if (bus.answers(addresses[which])) {
            add(bus, which);
            found++;
        }
    }
    return found;
}

void setup() {
    output_begin();
    delay(BOOT_MS);
    FlashStore::forget_older();
    status_led_begin();
    static I2cBus first(0, Wire, GYROCAL_SDA, GYROCAL_SCL);
    unsigned found = add_those_that_answer(first);
#if defined(GYROCAL_SDA2) && defined(GYROCAL_SCL2)
    static I2cBus second(1, Wire1, GYROCAL_SDA2, GYROCAL_SCL2);
    found += add_those_that_answer(second);
#endif
    if (found == 0) {
        add(first, 0); /* it says what is wrong, and finds the sensor once it is there */
    }
    esp_task_wdt_init(WATCHDOG_S, true);
    for (Sensor *sensor : sensors) {
        if (sensor != nullptr) {
            sensor->start();
        }
    }
}

void loop() {
    char data[128];
    const int waiting = Serial.available();
    if (waiting > 0) {
        const size_t room = static_cast<size_t>(waiting) < sizeof data ? static_cast<size_t>(waiting) : sizeof data;
        const size_t n = Serial.readBytes(data, room);
        for (Sensor *sensor : sensors) {
            if (sensor != nullptr) {
                sensor->hear(data, n);
            }
        }
    }
    status_led_show();
    delay(IDLE_MS);
}
