/* The serial port: what the port writes goes to stdout at the speed of the wire. */
#include "simulated_board.h"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <string>

#define SERIAL_BYTE_US (10e6 / 921600)

HardwareSerial Serial;
EspClass ESP;
static std::deque<char> typed;

/* The hardware's own buffer, and that of the driver, which holds a note beside each write and a header before either. All of
   the port's functions share one lock, as Arduino's do. */
#define FIFO_BYTES 128
#define NOTE_BYTES 12
#define HEADER_BYTES 8

struct queued {
    double left_us; /* when its last byte is on the wire */
    size_t takes;
};

static semaphore serial_lock;
static bool serial_begun;
static size_t tx_bytes;
static std::deque<queued> tx_queue;
static double tx_busy_until_us;

/* A native USB connector that nobody reads: what the driver's buffer holds stays there, and a write that finds no room waits for a
   while, the lock held, and takes nothing. */
#define UNREAD_WAIT_US 250e3
#define UNREAD_BYTES (tx_bytes > 0 ? tx_bytes : 256u)

static bool is_read = true;
static std::string unread;

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

/* What of the driver's buffer is taken. A write's part is given back when its last byte is in the hardware's. */
static size_t tx_taken() {
    size_t taken = 0;
    while (!tx_queue.empty() && tx_queue.front().left_us - FIFO_BYTES * SERIAL_BYTE_US <= static_cast<double>(now_us)) {
        tx_queue.pop_front();
    }
    for (const queued &write : tx_queue) {
        taken += write.takes;
    }
    return taken;
}

struct serial_guard {
    serial_guard() { xSemaphoreTake(&serial_lock, portMAX_DELAY); }
    ~serial_guard() { xSemaphoreGive(&serial_lock); }
};

void listen(bool on) {
    is_read = on;
    if (on) {
        show(reinterpret_cast<const uint8_t *>(unread.data()), unread.size());
        tx_busy_until_us = static_cast<double>(now_us) + SERIAL_BYTE_US * static_cast<double>(unread.size());
        unread.clear();
    }
}

void EspClass::restart() {
    printf("# restart\n");
    fflush(stdout);
    _Exit(0);
}

void HardwareSerial::begin(unsigned long baud) {
    serial_begun = true;
    static const uint8_t boot[] = {0x80, 0xf8, 0x00, 0xff, 0x1c, 0xe0, 0x80, 0x24, 0xfe}; /* of the ROM's log, at 115200 baud */
    show(boot, sizeof boot);
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
    tx_bytes = serial_begun ? tx_bytes : n; /* afterwards it is refused */
    return n;
}

int HardwareSerial::available() {
    serial_guard guard;
    return static_cast<int>(typed.size());
}

int HardwareSerial::availableForWrite() {
    serial_guard guard;
    return static_cast<int>(is_read ? FIFO_BYTES + tx_bytes - tx_waiting() : UNREAD_BYTES - unread.size()); /* without notes and headers */
}

/* What finds no room waits for the wire, the lock held. */
size_t HardwareSerial::write(const uint8_t *data, size_t n) {
    serial_guard guard;
    if (!is_read) {
        if (unread.size() + n > UNREAD_BYTES) {
            pass(UNREAD_WAIT_US);
            return 0;
        }
        unread.append(reinterpret_cast<const char *>(data), n);
        return n;
    }
    const size_t takes = HEADER_BYTES + NOTE_BYTES + HEADER_BYTES + (n + 3u) / 4u * 4u;
    while (tx_taken() + takes > tx_bytes && !tx_queue.empty()) {
        pass(tx_queue.front().left_us - FIFO_BYTES * SERIAL_BYTE_US - static_cast<double>(now_us) + 1.0);
    }
    show(data, n);
    const double from_us = tx_busy_until_us > static_cast<double>(now_us) ? tx_busy_until_us : static_cast<double>(now_us);
    tx_busy_until_us = from_us + SERIAL_BYTE_US * static_cast<double>(n);
    tx_queue.push_back({tx_busy_until_us, takes});
    return n;
}

int HardwareSerial::read() {
    char byte = 0;
    return readBytes(&byte, 1) == 1 ? byte : -1;
}

size_t Print::print(const char *text) {
    return write(reinterpret_cast<const uint8_t *>(text), strlen(text));
}

size_t Print::print(double value, int digits) {
    char text[32];
    snprintf(text, sizeof text, "%.*f", digits, value);
    return print(text);
}

size_t Print::println(const char *text) {
    return print(text) + print("\r\n");
}

size_t Print::println(double value, int digits) {
    return print(value, digits) + print("\r\n");
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
