#include "radio.h"

#include <Arduino.h>
#include <esp_timer.h>
#include <string.h>

#define QUEUE_BYTES 16384 /* a second of 145 samples/s takes 11 KB */

static gc_remote_t remote;
static portMUX_TYPE lock = portMUX_INITIALIZER_UNLOCKED; /* held for a copy of one sentence at most */

struct Locked {
    Locked() { portENTER_CRITICAL(&lock); }
    ~Locked() { portEXIT_CRITICAL(&lock); }
};

static uint64_t now_us() {
    return static_cast<uint64_t>(esp_timer_get_time());
}

bool radio_begin(const char *token) {
    if (remote.queue == nullptr) {
        char *queue = static_cast<char *>(malloc(QUEUE_BYTES));
        if (queue == nullptr) {
            return false;
        }
        const Locked locked;
        gc_remote_init(&remote, queue, QUEUE_BYTES);
    }
    const Locked locked;
    gc_remote_set_token(&remote, token, strlen(token));
    return true;
}

int radio_send(const char *data, size_t n) {
    if (!radio_has_reader()) {
        return -1;
    }
    const Locked locked;
    return gc_remote_tell(&remote, data, n);
}

bool radio_has_reader() {
    return remote.state == GC_REMOTE_READER;
}

uint32_t radio_refused() {
    return remote.refused;
}

bool radio_connect() {
    const Locked locked;
    return gc_remote_connect(&remote, now_us());
}

void radio_disconnect() {
    const Locked locked;
    gc_remote_disconnect(&remote);
}

/* No other task looks at the line that is read. */
bool radio_hear(const char *data, size_t n, radio_command_t command) {
    for (size_t i = 0; i < n; i++) {
        const int got = gc_remote_hear(&remote, data[i], now_us());
        if (got < 0) {
            return false;
        }
        if (got > 0) {
            command(remote.line, remote.reader.n);
        }
    }
    return true;
}

bool radio_is_over() {
    const Locked locked;
    return gc_remote_is_over(&remote, now_us());
}

/* What waits stays where it is until it is taken. */
size_t radio_waiting(size_t most, const char **data) {
    const Locked locked;
    return gc_remote_waiting(&remote, most, data, now_us());
}

void radio_took(size_t n) {
    const Locked locked;
    gc_remote_took(&remote, n, now_us());
}
