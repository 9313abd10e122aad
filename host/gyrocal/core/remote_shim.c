/* A remote reader with its queue, for core/remote.py. */
#include "gc_error.h"
#include "gc_remote.h"

#include <string.h>

#define QUEUE_BYTES 16384

typedef struct {
    gc_remote_t remote;
    char queue[QUEUE_BYTES];
} shim_t;

size_t gyrocal_remote_bytes(void) {
    return sizeof(shim_t);
}

void gyrocal_remote_init(shim_t *shim, const char *token) {
    gc_remote_init(&shim->remote, shim->queue, sizeof shim->queue);
    gc_remote_set_token(&shim->remote, token, strlen(token));
}

bool gyrocal_remote_connect(shim_t *shim, uint64_t now_us) {
    return gc_remote_connect(&shim->remote, now_us);
}

void gyrocal_remote_disconnect(shim_t *shim) {
    gc_remote_disconnect(&shim->remote);
}

/* Writes the commands among n bytes to `commands`, each with its newline, and returns the length; GC_E_TOKEN without the token. */
int gyrocal_remote_hear(shim_t *shim, const char *data, size_t n, uint64_t now_us, char *commands) {
    size_t length = 0;
    for (size_t i = 0; i < n; i++) {
        const int got = gc_remote_hear(&shim->remote, data[i], now_us);
        if (got < 0) {
            return got;
        }
        if (got > 0) {
            memcpy(commands + length, shim->remote.line, shim->remote.reader.n);
            length += shim->remote.reader.n;
            commands[length++] = '\n';
        }
    }
    return (int)length;
}

bool gyrocal_remote_is_reader(const shim_t *shim) {
    return shim->remote.state == GC_REMOTE_READER;
}

bool gyrocal_remote_is_over(shim_t *shim, uint64_t now_us) {
    return gc_remote_is_over(&shim->remote, now_us);
}

int gyrocal_remote_tell(shim_t *shim, const char *data, size_t n) {
    return gc_remote_tell(&shim->remote, data, n);
}

size_t gyrocal_remote_waiting(shim_t *shim, size_t most, const char **data, uint64_t now_us) {
    return gc_remote_waiting(&shim->remote, most, data, now_us);
}

void gyrocal_remote_took(shim_t *shim, size_t n, uint64_t now_us) {
    gc_remote_took(&shim->remote, n, now_us);
}

uint32_t gyrocal_remote_refused(const shim_t *shim) {
    return shim->remote.refused;
}
