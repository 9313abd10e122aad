#include "output.h"

#include "board.h"

#include <Arduino.h>
#include <freertos/FreeRTOS.h>
#include <freertos/ringbuf.h>
#include <freertos/task.h>

#define RING_BYTES 16384 /* 0.18 s of the wire */
#define TX_BYTES 2048    /* without a buffer of its own the port's write waits for the wire */
#define RX_BYTES 1024
#define STACK_BYTES 3072
#define PRIORITY 2

static RingbufHandle_t ring;

static void run(void *) {
    for (;;) {
        size_t n = 0;
        void *item = xRingbufferReceive(ring, &n, portMAX_DELAY);
        if (item != nullptr) {
            Serial.write(static_cast<const uint8_t *>(item), n);
            vRingbufferReturnItem(ring, item);
        }
    }
}

void output_begin() {
    Serial.setTxBufferSize(TX_BYTES); /* both before begin */
    Serial.setRxBufferSize(RX_BYTES);
    Serial.begin(BAUD);
    ring = xRingbufferCreate(RING_BYTES, RINGBUF_TYPE_NOSPLIT);
    configASSERT(ring != nullptr);
    xTaskCreate(run, "output", STACK_BYTES, nullptr, PRIORITY, nullptr);
}

int output_send(const char *data, size_t n) {
    return xRingbufferSend(ring, data, n, 0) == pdTRUE ? static_cast<int>(n) : 0;
}
