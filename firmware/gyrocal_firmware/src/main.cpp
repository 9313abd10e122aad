/* The ESP32's port of the core: finds the sensors, gives each a task, passes commands on and shows the light. */
#include "board.h"
#include "gc_lsm6dso.h"
#include "i2c_bus.h"
#include "output.h"
#include "sensor.h"
#include "status_led.h"

#include <Arduino.h>
#include <esp_task_wdt.h>

#define WATCHDOG_S 5
#define BOOT_MS 20 /* the sensors' own */
#define IDLE_MS 4

static Sensor *sensors[MAX_SENSORS];
static unsigned count;

static void add(I2cBus &bus, uint8_t address) {
#if defined(GYROCAL_INT1)
    const int pin_int1 = count == 0 ? GYROCAL_INT1 : -1;
#else
    const int pin_int1 = -1;
#endif
    sensors[count] = new Sensor(bus, address, count, pin_int1);
    count++;
}

static void add_those_that_answer(I2cBus &bus) {
    static const uint8_t addresses[] = {GC_LSM6DSO_ADDRESS, GC_LSM6DSO_ADDRESS_LOW};
    bus.begin();
    for (uint8_t address : addresses) {
        if (bus.answers(address)) {
            add(bus, address);
        }
    }
}

void setup() {
    output_begin();
    delay(BOOT_MS);
    static I2cBus first(Wire, GYROCAL_SDA, GYROCAL_SCL);
    add_those_that_answer(first);
#if defined(GYROCAL_SDA2) && defined(GYROCAL_SCL2)
    static I2cBus second(Wire1, GYROCAL_SDA2, GYROCAL_SCL2);
    add_those_that_answer(second);
#endif
    if (count == 0) {
        add(first, GC_LSM6DSO_ADDRESS); /* it says what is wrong, and finds the sensor once it is there */
    }
    status_led_begin(count);
    esp_task_wdt_init(WATCHDOG_S, true);
    for (unsigned i = 0; i < count; i++) {
        sensors[i]->start();
    }
}

void loop() {
    char data[128];
    const int waiting = Serial.available();
    if (waiting > 0) {
        const size_t room = static_cast<size_t>(waiting) < sizeof data ? static_cast<size_t>(waiting) : sizeof data;
        const size_t n = Serial.readBytes(data, room);
        for (unsigned i = 0; i < count; i++) {
            sensors[i]->hear(data, n);
        }
    }
    status_led_show();
    delay(IDLE_MS);
}
