#include "output.h"

#include "board.h"
#include "gc_device.h"
#include "radio.h"
#include "reset_reason.h"

#include <Arduino.h>
#include <freertos/FreeRTOS.h>
#include <freertos/ringbuf.h>
#include <freertos/task.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define RING_BYTES 16384 /* 0.18 s of the wire */
#define KEPT_FREE_BYTES 2048 /* reserved for answers to commands while samples fill the wire */
#define TX_BYTES 4096
#define QUEUED_BYTES 1024 /* of them, 11 ms of the wire */
#define PART_BYTES 512
#define RX_BYTES 1024
#define STACK_BYTES 3072
#define PRIORITY 2
#define SAY_BYTES 160

static RingbufHandle_t ring;

/* A write that finds no room waits with the port's lock held, and no command can be received. availableForWrite tells more than
   there is room for: it counts the hardware's own buffer, but not the 28 bytes and more that the driver keeps beside each write.
   So the driver is given little at a time, and the rest waits here. */
static void write_all(const uint8_t *data, size_t n) {
    while (n > 0) {
        const size_t part = n < PART_BYTES ? n : PART_BYTES;
        while (Serial.availableForWrite() < static_cast<int>(TX_BYTES - QUEUED_BYTES + part)) {
            delay(1);
        }
        const size_t done = Serial.write(data, part);
        data += done;
        n -= done;
    }
}

static void run(void *) {
    for (;;) {
        size_t n = 0;
        void *item = xRingbufferReceive(ring, &n, portMAX_DELAY);
        if (item != nullptr) {
            write_all(static_cast<const uint8_t *>(item), n);
            vRingbufferReturnItem(ring, item);
        }
    }
}

void output_begin() {
    Serial.setTxBufferSize(TX_BYTES); /* both must be set before begin */
    Serial.setRxBufferSize(RX_BYTES);
    Serial.begin(BAUD);
    ring = xRingbufferCreate(RING_BYTES, RINGBUF_TYPE_NOSPLIT);
    if (ring == nullptr || xTaskCreate(run, "output", STACK_BYTES, nullptr, PRIORITY, nullptr) != pdPASS) {
        static const char why[] = "# no memory for the output: the board restarts\n";
        Serial.write(reinterpret_cast<const uint8_t *>(why), sizeof why - 1u);
        Serial.flush();
        ESP.restart();
    }
    (void)output_send("\n", 1); /* the ROM's log came at another speed: a reader sees noise without an end */
    const esp_reset_reason_t reason = esp_reset_reason();
    output_say("gyrocal %s, reset reason %d, %s", GC_FIRMWARE_VERSION, static_cast<int>(reason), reset_reason_name(reason));
}

static int send_by_cable(const char *data, size_t n) {
    if (gc_wire_is_sample(data, n) && xRingbufferGetCurFreeSize(ring) < n + KEPT_FREE_BYTES) {
        return 0;
    }
    return xRingbufferSend(ring, data, n, 0) == pdTRUE ? static_cast<int>(n) : 0;
}

/* A reader by radio is the one for whom sentences are counted. The cable carries them too, as far as it has room. */
int output_send(const char *data, size_t n) {
    const int by_radio = radio_send(data, n);
    if (by_radio == 0) {
        return 0;
    }
    const int by_cable = send_by_cable(data, n);
    return by_radio > 0 ? by_radio : by_cable;
}

void output_say(const char *format, ...) {
    char text[SAY_BYTES] = "# ";
    va_list arguments;
    va_start(arguments, format);
    const int n = vsnprintf(text + 2, sizeof text - 3u, format, arguments);
    va_end(arguments);
    if (n > 0) {
        const size_t length = strlen(text);
        text[length] = '\n';
        (void)output_send(text, length + 1u);
    }
}
