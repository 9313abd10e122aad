/* What passes between tasks: mutexes, stream buffers and ring buffers of FreeRTOS. */
#include "simulated_board.h"

#include <algorithm>
#include <deque>
#include <string>

struct stream_buffer {
    size_t room;
    std::deque<char> bytes;
};

struct ring_buffer {
    size_t room;
    std::deque<std::string> items;
};

extern "C" {
SemaphoreHandle_t xSemaphoreCreateMutex() {
    return new semaphore;
}

BaseType_t xSemaphoreTake(SemaphoreHandle_t s, TickType_t ticks) {
    if (s->taken) {
        wait([s] { return !s->taken; }, after(ticks));
    }
    s->taken = true;
    return pdTRUE;
}

BaseType_t xSemaphoreGive(SemaphoreHandle_t s) {
    s->taken = false;
    return pdTRUE;
}

StreamBufferHandle_t xStreamBufferCreate(size_t bytes, size_t) {
    return new stream_buffer{bytes, {}};
}

size_t xStreamBufferSend(StreamBufferHandle_t b, const void *data, size_t n, TickType_t) {
    const char *from = static_cast<const char *>(data);
    const size_t fits = n < b->room - b->bytes.size() ? n : b->room - b->bytes.size();
    b->bytes.insert(b->bytes.end(), from, from + fits);
    return fits;
}

size_t xStreamBufferReceive(StreamBufferHandle_t b, void *data, size_t n, TickType_t) {
    const size_t got = n < b->bytes.size() ? n : b->bytes.size();
    std::copy(b->bytes.begin(), b->bytes.begin() + static_cast<long>(got), static_cast<char *>(data));
    b->bytes.erase(b->bytes.begin(), b->bytes.begin() + static_cast<long>(got));
    return got;
}

RingbufHandle_t xRingbufferCreate(size_t bytes, RingbufferType_t) {
    return new ring_buffer{bytes, {}};
}

size_t xRingbufferGetCurFreeSize(RingbufHandle_t r) {
    return r->room < 8 ? 0 : r->room - 8;
}

BaseType_t xRingbufferSend(RingbufHandle_t r, const void *item, size_t n, TickType_t ticks) {
    const size_t takes = (n + 3) / 4 * 4 + 8; /* aligned, and a header */
    if (takes > r->room && ticks > 0) {
        wait([r, takes] { return takes <= r->room; }, after(ticks));
    }
    if (takes > r->room) {
        return pdFALSE;
    }
    r->room -= takes;
    r->items.emplace_back(static_cast<const char *>(item), n);
    return pdTRUE;
}

void *xRingbufferReceive(RingbufHandle_t r, size_t *n, TickType_t ticks) {
    wait([r] { return !r->items.empty(); }, after(ticks));
    if (r->items.empty()) {
        return nullptr;
    }
    *n = r->items.front().size();
    return &r->items.front()[0];
}

void vRingbufferReturnItem(RingbufHandle_t r, void *) {
    r->room += (r->items.front().size() + 3) / 4 * 4 + 8;
    r->items.pop_front();
}
}
