/* The serial port: what the port writes goes to stdout at the speed of the wire. */
#include "simulated_board.h"

#include <cstdio>
#include <cstdlib>
#include <deque>
#include <string>

#define SERIAL_BYTE_US (10e6 / 921600)

HardwareSerial Serial;
EspClass ESP;
static std::deque<char> typed;

/* The driver's buffer, which the wire empties. All of the port's functions share one lock, as Arduino's do. */
static semaphore serial_lock;
static bool serial_begun;
static size_t tx_room_bytes = 128;
static double tx_busy_until_us;

/* What was written comes out line by line: the light's own lines stand between them. */
static std::string unfinished;

static void show(const uint8_t *data, size_t n) {
    unfinished.append(reinterpret_cast<const char *>(data), n);
    const size_t whole = unfinished.rfind('\n') + 1;
    fwrite(unfinished.data(), 1, whole, stdout);
    unfinished.erase(0, whole);
}

static size_t tx_waiting() {
    const double us = tx_busy_until_us - static_cast<double>(now_us);
    return us > 0.0 ? static_cast<size_t>(us / SERIAL_BYTE_US) + 1u : 0u;
}

struct serial_guard {
    serial_guard() { xSemaphoreTake(&serial_lock, portMAX_DELAY); }
    ~serial_guard() { xSemaphoreGive(&serial_lock); }
};

void EspClass::restart() {
    printf("# restart\n");
    fflush(stdout);
    _Exit(0);
}

void HardwareSerial::begin(unsigned long baud) {
    serial_begun = true;
    if (baud != 921600) {
        _Exit(2);
    }
}

void HardwareSerial::flush() {
}

size_t HardwareSerial::setRxBufferSize(size_t n) {
    return n;
}

size_t HardwareSerial::setTxBufferSize(size_t n) {
    tx_room_bytes = serial_begun ? tx_room_bytes : n; /* afterwards it is refused */
    return n;
}

int HardwareSerial::available() {
    serial_guard guard;
    return static_cast<int>(typed.size());
}

int HardwareSerial::availableForWrite() {
    serial_guard guard;
    return static_cast<int>(tx_room_bytes - (tx_waiting() < tx_room_bytes ? tx_waiting() : tx_room_bytes));
}

/* What finds no room waits for the wire, the lock held. */
size_t HardwareSerial::write(const uint8_t *data, size_t n) {
    serial_guard guard;
    show(data, n);
    const double from_us = tx_busy_until_us > static_cast<double>(now_us) ? tx_busy_until_us : static_cast<double>(now_us);
    tx_busy_until_us = from_us + SERIAL_BYTE_US * static_cast<double>(n);
    if (tx_waiting() > tx_room_bytes) {
        pass(SERIAL_BYTE_US * static_cast<double>(tx_waiting() - tx_room_bytes));
    }
    return n;
}

size_t Stream::readBytes(char *buffer, size_t n) {
    serial_guard guard;
    size_t got = 0;
    for (; got < n && !typed.empty(); got++) {
        buffer[got] = typed.front();
        typed.pop_front();
    }
    return got;
}

void type(const std::string &text) {
    typed.insert(typed.end(), text.begin(), text.end());
}
