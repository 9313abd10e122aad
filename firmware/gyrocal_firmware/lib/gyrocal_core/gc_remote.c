#include "gc_remote.h"

#include "gc_error.h"

#include <string.h>

#define WORD "token "
#define WORD_N (sizeof WORD - 1u)

void gc_remote_init(gc_remote_t *remote, char *queue, size_t capacity) {
    memset(remote, 0, sizeof *remote);
    remote->queue = queue;
    remote->capacity = capacity;
}

bool gc_remote_may_be_token(const char *text, size_t n) {
    bool may_be = n >= GC_TOKEN_MIN && n <= GC_TOKEN_MAX;
    for (size_t i = 0; i < n && may_be; i++) {
        may_be = text[i] > ' ' && text[i] <= '~';
    }
    return may_be;
}

void gc_remote_set_token(gc_remote_t *remote, const char *token, size_t n) {
    memset(remote->token, 0, sizeof remote->token);
    remote->token_n = gc_remote_may_be_token(token, n) ? n : 0u;
    memcpy(remote->token, token, remote->token_n);
}

bool gc_remote_connect(gc_remote_t *remote, uint64_t now_us) {
    if (remote->state != GC_REMOTE_NONE) {
        return false;
    }
    remote->state = GC_REMOTE_STRANGER;
    remote->since_us = now_us;
    gc_line_reader_init(&remote->reader, remote->line, sizeof remote->line);
    remote->first = 0;
    remote->n = 0;
    return true;
}

void gc_remote_disconnect(gc_remote_t *remote) {
    remote->state = GC_REMOTE_NONE;
    remote->n = 0;
}

/* Takes as long for every text, so that the time does not tell how many characters are right. */
static bool is_token(const gc_remote_t *remote, const char *text, size_t n) {
    size_t differs = n ^ remote->token_n;
    for (size_t i = 0; i < GC_TOKEN_MAX; i++) {
        differs |= (unsigned char)((i < n ? text[i] : '\0') ^ remote->token[i]);
    }
    return differs == 0u && remote->token_n > 0u;
}

static bool gives_token(const gc_remote_t *remote) {
    const size_t n = remote->reader.n;
    return n > WORD_N && memcmp(remote->line, WORD, WORD_N) == 0 && is_token(remote, remote->line + WORD_N, n - WORD_N);
}

int gc_remote_hear(gc_remote_t *remote, char byte, uint64_t now_us) {
    if (remote->state == GC_REMOTE_NONE || !gc_line_push_cut(&remote->reader, byte)) {
        return 0;
    }
    if (remote->state == GC_REMOTE_READER) {
        return 1;
    }
    if (!gives_token(remote)) {
        remote->refused++;
        return GC_E_TOKEN;
    }
    remote->state = GC_REMOTE_READER;
    remote->since_us = now_us;
    return 0;
}

bool gc_remote_is_over(gc_remote_t *remote, uint64_t now_us) {
    const uint64_t waited_us = now_us - remote->since_us;
    if (remote->state == GC_REMOTE_STRANGER && waited_us > GC_REMOTE_TOKEN_US) {
        remote->refused++;
        return true;
    }
    return remote->state == GC_REMOTE_READER && remote->n > 0u && waited_us > GC_REMOTE_STALL_US;
}

int gc_remote_tell(gc_remote_t *remote, const char *data, size_t n) {
    const size_t quarter = remote->capacity / 4u;
    const size_t kept_free = !gc_wire_is_sample(data, n) ? 0u : quarter < GC_REMOTE_KEPT_FREE ? quarter : GC_REMOTE_KEPT_FREE;
    if (remote->state != GC_REMOTE_READER || remote->capacity - remote->n < n + kept_free) {
        return 0;
    }
    const size_t at = (remote->first + remote->n) % remote->capacity;
    const size_t to_end = remote->capacity - at < n ? remote->capacity - at : n;
    memcpy(remote->queue + at, data, to_end);
    memcpy(remote->queue, data + to_end, n - to_end);
    remote->n += n;
    return (int)n;
}

size_t gc_remote_waiting(gc_remote_t *remote, size_t most, const char **data, uint64_t now_us) {
    if (remote->n == 0u) {
        remote->since_us = remote->state == GC_REMOTE_READER ? now_us : remote->since_us;
        return 0;
    }
    const size_t to_end = remote->capacity - remote->first;
    const size_t n = remote->n < to_end ? remote->n : to_end;
    *data = remote->queue + remote->first;
    return n < most ? n : most;
}

void gc_remote_took(gc_remote_t *remote, size_t n, uint64_t now_us) {
    if (n > 0u) {
        remote->first = (remote->first + n) % remote->capacity;
        remote->n -= n;
        remote->since_us = now_us;
    }
}
