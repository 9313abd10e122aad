#include "status_led.h"

#include "board.h"

#include <Arduino.h>

#define SLOT_MS 125u

struct Look {
    uint16_t lit; /* in each of 16 slots, the lowest bit first */
    uint8_t red, green, blue;
};

static const Look looks[] = {
    {0x0001, 0, 0, 24},   /* idle: short blink every 2 s, blue */
    {0xFFFF, 24, 24, 24}, /* recording: on, white */
    {0x5555, 24, 16, 0},  /* flip: four blinks a second, yellow */
    {0x00FF, 0, 24, 0},   /* done: 1 s on, 1 s off, green */
    {0x0015, 32, 0, 0},   /* misfit: three short blinks every 2 s, red */
};

static volatile gc_led_t state_of[MAX_SENSORS];
static bool there[MAX_SENSORS];

static void light(const Look &look, bool on) {
#if defined(GYROCAL_RGB_LED)
    neopixelWrite(GYROCAL_RGB_LED, on ? look.red : 0, on ? look.green : 0, on ? look.blue : 0);
#elif defined(GYROCAL_LED)
    (void)look;
    digitalWrite(GYROCAL_LED, on ? HIGH : LOW);
#else
    (void)look;
    (void)on;
#endif
}

void status_led_begin() {
#if defined(GYROCAL_LED)
    pinMode(GYROCAL_LED, OUTPUT);
#endif
}

void status_led_add(unsigned imu) {
    there[imu] = true;
}

void status_led_set(unsigned imu, gc_led_t state) {
    state_of[imu] = state;
}

/* Shows the sensor that is furthest behind. If all are done, a misfit of any sensor is shown. */
static gc_led_t shown() {
    gc_led_t least = GC_LED_MISFIT, most = GC_LED_IDLE;
    for (unsigned i = 0; i < MAX_SENSORS; i++) {
        least = there[i] && state_of[i] < least ? state_of[i] : least;
        most = there[i] && state_of[i] > most ? state_of[i] : most;
    }
    return least < GC_LED_DONE ? least : most;
}

void status_led_show() {
    static int last = -1;
    const gc_led_t state = shown();
    const Look &look = looks[state];
    const bool on = look.lit >> (millis() / SLOT_MS % 16u) & 1u;
    const int now = 2 * state + (on ? 1 : 0);
    if (now != last) {
        light(look, on);
        last = now;
    }
}
