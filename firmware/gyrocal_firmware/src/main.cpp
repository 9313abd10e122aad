/* The port of the core to the ESP32. It starts a task for each, forwards commands and sets the LED. */
#include "ble.h"
#include "board.h"
#include "output.h"
#include "sensors.h"
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
    sensors_find();
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
        sensors_look_again();
    }
    status_led_show();
    delay(IDLE_MS);
}
