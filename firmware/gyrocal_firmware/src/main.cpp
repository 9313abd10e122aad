/* The port of the core to the ESP32. It finds the sensors, starts a task for each, forwards commands and sets the LED. */
#include "board.h"
#include "i2c_bus.h"
#include "output.h"
#include "part.h"
#include "sensor.h"
#include "status_led.h"

#include <Arduino.h>
#include <esp_task_wdt.h>

#define WATCHDOG_S 5
#define BOOT_MS 20 /* start-up time of the sensors */
#define IDLE_MS 4

static Sensor *sensors[MAX_SENSORS]; /* by number; null if no sensor answered */
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
        add(first, 0); /* it reports the error, and finds the sensor when it is connected */
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
