/* The port of the core to the ESP32. It finds the sensors, starts a task for each, forwards commands and sets the LED. */
#include "ble.h"
#include "board.h"
#include "i2c_bus.h"
#include "output.h"
#include "part.h"
#include "sensor.h"
#include "status_led.h"
#include "wireless.h"

#include <Arduino.h>
#include <esp_idf_version.h>
#include <esp_task_wdt.h>
#include <string.h>

#define WATCHDOG_S 10
#define BOOT_MS 100 /* start-up time of the slowest sensor */
#define IDLE_MS 4
#define LOOK_EVERY_MS 1000u /* for sensors that have not answered yet */
#define TELL_MS 100         /* until what was said is on the wire */

static I2cBus *buses[MAX_SENSORS / SENSORS_A_BUS]; /* null if the board does not have it */
static Sensor *sensors[MAX_SENSORS];               /* by number; null if no sensor has answered */
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
#if defined(GYROCAL_INT1)
    const int pin_int1 = imu == GYROCAL_INT1_SENSOR ? GYROCAL_INT1 : -1;
#else
    const int pin_int1 = -1;
#endif
    sensors[imu] = new Sensor(*buses[imu / SENSORS_A_BUS], address, imu, pin_int1);
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

/* A sensor that is connected later is taken up, but not during a run, whose samples would be late. */
static void look_again() {
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

static void begin_watchdog() {
#if ESP_IDF_VERSION_MAJOR >= 5
    const esp_task_wdt_config_t config = {WATCHDOG_S * 1000u, 1u, true}; /* the idle task of core 0 too, as before version 5 */
    if (esp_task_wdt_reconfigure(&config) != ESP_OK) {
        esp_task_wdt_init(&config);
    }
#else
    esp_task_wdt_init(WATCHDOG_S, true);
#endif
}

void setup() {
    output_begin();
    delay(BOOT_MS);
    FlashStore::prepare();
    wifi_begin();
    status_led_begin();
    begin_buses();
    stands_in = !add_those_that_answer();
    if (stands_in) {
        look_at_other_pins();
        add(0, places[0][0]);
    }
    begin_watchdog();
    for (Sensor *sensor : sensors) {
        if (sensor != nullptr) {
            sensor->start();
        }
    }
}

/* Lines are passed on whole, so that those of the cable and of a radio do not mix. */
static void forward(const char *line, size_t n) {
    char text[GC_COMMAND_MAX + 2]; /* one byte more than a command has, so that a sensor refuses a longer one, and the line's end */
    memcpy(text, line, n);
    text[n] = '\n';
    for (Sensor *sensor : sensors) {
        if (sensor != nullptr) {
            sensor->hear(text, n + 1u);
        }
    }
}

static void hear_cable() {
    static char line[GC_COMMAND_MAX + 1];
    static gc_line_reader_t reader = {line, sizeof line, 0, false, false, false};
    char data[128];
    const int waiting = Serial.available();
    if (waiting <= 0) {
        return;
    }
    const size_t room = static_cast<size_t>(waiting) < sizeof data ? static_cast<size_t>(waiting) : sizeof data;
    const size_t n = Serial.readBytes(data, room);
    for (size_t i = 0; i < n; i++) {
        if (gc_line_push_cut(&reader, data[i])) {
            forward(reader.line, reader.n);
        }
    }
}

void loop() {
    static uint32_t looked_ms = 0;
    hear_cable();
    wifi_step(forward);
    ble_step(forward);
    if (millis() - looked_ms >= LOOK_EVERY_MS) {
        looked_ms = millis();
        look_again();
    }
    status_led_show();
    delay(IDLE_MS);
}
