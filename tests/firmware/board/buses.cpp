/* Four sensors on two buses, the interrupt pin of the first, and the pins of the light. */
#include "Wire.h"
#include "simulated_board.h"

extern "C" {
#include "emul_spi.h"
}

#include <cmath>
#include <cstdio>
#include <cstring>
#include <deque>
#include <istream>
#include <vector>

#define NO_EVENT_US 1000000.0 /* IDF 4.4 waits so long for an event of a bus that does not move, whatever the timeout */
#define NOISE_COUNTS 5.0
#define BUSES 2

static emul_t chip[CHIPS];
static bool present[CHIPS], holds[CHIPS];
static int16_t world[CHIPS][EMUL_WORDS];
static struct {
    int sda, scl;
} wired[BUSES] = {{GYROCAL_SDA, GYROCAL_SCL}, {GYROCAL_SDA2, GYROCAL_SCL2}}; /* what the sensors are wired to */
static bool tied_low[BUSES], hung[BUSES];
static int clocks[BUSES]; /* of a bus that nobody drives but the pins */
static struct {
    void (*handler)(void *);
    void *argument;
    bool high;
} int1;

static double gaussian() {
    static uint32_t lcg = 1;
    double sum = -6.0;
    for (int i = 0; i < 12; i++) {
        lcg = lcg * 1664525u + 1013904223u;
        sum += lcg / 4294967296.0;
    }
    return sum;
}

/* Every sample has a noise of its own. */
static void advance(int i, uint64_t t_us) {
    double before_us = -1.0;
    while (present[i] && emul_tick_us(&chip[i]) > before_us && emul_tick_us(&chip[i]) <= static_cast<double>(t_us)) {
        int16_t noisy[EMUL_WORDS];
        before_us = emul_tick_us(&chip[i]);
        memcpy(noisy, world[i], sizeof noisy);
        for (int axis = 1; axis <= 3; axis++) {
            noisy[axis] = static_cast<int16_t>(std::lround(world[i][axis] + NOISE_COUNTS * gaussian()));
        }
        emul_set_world(&chip[i], noisy);
        emul_advance(&chip[i], static_cast<uint64_t>(before_us) + 1u);
    }
}

uint64_t next_edge_us() {
    const double tick_us = int1.handler != nullptr && present[0] ? emul_tick_us(&chip[0]) : 0.0;
    return tick_us > 0.0 && tick_us > static_cast<double>(now_us) ? static_cast<uint64_t>(tick_us) + 1u : NEVER;
}

void look_at_pins() {
    if (int1.handler == nullptr) {
        return;
    }
    advance(0, now_us);
    const bool high = present[0] && emul_int1(&chip[0]);
    const bool rose = high && !int1.high;
    int1.high = high;
    if (rose) {
        int1.handler(int1.argument);
    }
}

static int bus_of(const TwoWire *wire) {
    return wire == &Wire ? 0 : 1;
}

static bool is_low(int pin) {
    bool low = false;
    for (int bus = 0; bus < BUSES; bus++) {
        low = low || (pin == wired[bus].sda && (tied_low[bus] || holds[2 * bus] || holds[2 * bus + 1]));
    }
    return low;
}

TwoWire Wire, Wire1;
static struct {
    semaphore lock; /* taken from the beginning of a transfer to its end */
    bool started;
    int sda, scl;
    uint32_t frequency;
    uint8_t address;
    std::vector<uint8_t> sent;
    std::deque<uint8_t> got;
} transfer[BUSES];

static int chip_at(const TwoWire *wire, uint8_t address) {
    const int bus = bus_of(wire);
    const bool connected = transfer[bus].sda == wired[bus].sda && transfer[bus].scl == wired[bus].scl;
    for (int i = 2 * bus; i < 2 * bus + 2 && connected; i++) {
        if (present[i] && emul_is_at(&chip[i], address)) {
            return i;
        }
    }
    return -1;
}

/* Returns false if a line stays low. */
static bool pass_transfer(int bus, size_t bytes) {
    if (hung[bus]) {
        wait(nullptr, NEVER);
    }
    if (is_low(transfer[bus].sda) || is_low(transfer[bus].scl)) {
        pass(NO_EVENT_US);
        return false;
    }
    pass(1e6 / transfer[bus].frequency * (9.0 * static_cast<double>(bytes) + 3.0));
    return true;
}

/* A bus that is started keeps its pins. */
bool TwoWire::begin(int sda, int scl, uint32_t frequency) {
    auto &t = transfer[bus_of(this)];
    xSemaphoreTake(&t.lock, portMAX_DELAY);
    if (!t.started && frequency > 0 && fails.count("wire") == 0) {
        t.started = true;
        t.sda = sda;
        t.scl = scl;
        t.frequency = frequency;
        clocks[bus_of(this)] = 0;
    }
    xSemaphoreGive(&t.lock);
    return t.started;
}

bool TwoWire::begin() {
    return begin(GYROCAL_SDA, GYROCAL_SCL, 100000);
}

bool TwoWire::setClock(uint32_t frequency) {
    transfer[bus_of(this)].frequency = frequency;
    return true;
}

bool TwoWire::end() {
    auto &t = transfer[bus_of(this)];
    xSemaphoreTake(&t.lock, portMAX_DELAY);
    t.started = false;
    xSemaphoreGive(&t.lock);
    return true;
}

void TwoWire::setTimeOut(uint16_t) {
}

void TwoWire::beginTransmission(uint8_t address) {
    auto &t = transfer[bus_of(this)];
    xSemaphoreTake(&t.lock, portMAX_DELAY);
    t.address = address;
    t.sent.clear();
}

size_t TwoWire::write(uint8_t data) {
    return write(&data, 1);
}

size_t TwoWire::write(const uint8_t *data, size_t n) {
    std::vector<uint8_t> &sent = transfer[bus_of(this)].sent;
    sent.insert(sent.end(), data, data + n);
    return n;
}

static uint8_t write_to(const TwoWire *wire) {
    auto &t = transfer[bus_of(wire)];
    if (!pass_transfer(bus_of(wire), t.sent.size() + 1u)) {
        return 5;
    }
    const int i = chip_at(wire, t.address);
    if (i < 0) {
        return 2;
    }
    advance(i, now_us);
    const bool empty = t.sent.empty();
    const int got = emul_write(&chip[i], now_us, t.address, empty ? 0 : t.sent[0], t.sent.data() + 1, empty ? 0 : t.sent.size() - 1);
    return got < 0 ? 2 : 0;
}

/* Without a stop it does no bus work: the reading that follows does. On a bus that is not started the lock is kept. */
uint8_t TwoWire::endTransmission(bool stop) {
    auto &t = transfer[bus_of(this)];
    if (!t.started) {
        return 4;
    }
    const uint8_t result = stop ? write_to(this) : 0;
    if (stop) {
        xSemaphoreGive(&t.lock);
    }
    return result;
}

static void read_from(const TwoWire *wire, uint8_t address, size_t n) {
    auto &t = transfer[bus_of(wire)];
    uint8_t data[128];
    t.got.clear();
    if (n > sizeof data || !pass_transfer(bus_of(wire), n + 3u)) { /* the real one's buffer holds as much */
        return;
    }
    const int i = chip_at(wire, address);
    if (i >= 0) {
        advance(i, now_us);
        const int got = emul_read(&chip[i], now_us, address, t.sent[0], data, n);
        t.got.insert(t.got.end(), data, data + (got > 0 ? got : 0));
    }
}

size_t TwoWire::requestFrom(uint8_t address, size_t n, bool) {
    auto &t = transfer[bus_of(this)];
    if (!t.started) {
        return 0;
    }
    read_from(this, address, n);
    xSemaphoreGive(&t.lock);
    return t.got.size();
}

int TwoWire::read() {
    std::deque<uint8_t> &got = transfer[bus_of(this)].got;
    const int byte = got.empty() ? -1 : got.front();
    if (!got.empty()) {
        got.pop_front();
    }
    return byte;
}

void pass_by_spi(unsigned die, unsigned mode, uint32_t hz, const uint8_t *out, size_t n_out, uint8_t *in, size_t n_in) {
    advance(0, now_us);
    if (!present[0]) {
        memset(in, 0xFF, n_in);
        return;
    }
    emul_spi(&chip[0], now_us, die, mode, hz, out, n_out, in, n_in);
    if (chip[0].spi_faults > 0) {
        fprintf(stderr, "a transfer by SPI that is not allowed: die %u, mode %u, %u Hz, %zu and %zu bytes\n", die, mode,
                static_cast<unsigned>(hz), n_out, n_in);
        abort();
    }
}

extern "C" {
void pinMode(uint8_t, uint8_t) {
}

/* Nine clocks, and a part that held the line has let go of it. */
void digitalWrite(uint8_t pin, uint8_t value) {
#if defined(GYROCAL_LED)
    if (pin == GYROCAL_LED) {
        printf("# light %.3f %d\n", 1e-6 * static_cast<double>(now_us), value);
    }
#endif
    turn_select(pin, value == HIGH);
    for (int bus = 0; bus < BUSES; bus++) {
        clocks[bus] += pin == wired[bus].scl && value == HIGH ? 1 : 0;
        if (clocks[bus] == 9) {
            holds[2 * bus] = holds[2 * bus + 1] = false;
        }
    }
}

int digitalRead(uint8_t pin) {
#if defined(GYROCAL_INT1)
    if (pin == GYROCAL_INT1) {
        advance(0, now_us);
        return present[0] && emul_int1(&chip[0]) ? HIGH : LOW;
    }
#endif
    return is_low(pin) ? LOW : HIGH;
}

void attachInterruptArg(uint8_t, void (*handler)(void *), void *argument, int) {
    int1.handler = handler;
    int1.argument = argument;
}

void neopixelWrite(uint8_t, uint8_t red, uint8_t green, uint8_t blue) {
    printf("# light %.3f %d %d %d\n", 1e-6 * static_cast<double>(now_us), red, green, blue);
}
}

/* The first of a bus has the address that is usual for its kind, the second the other one. */
void power_on(unsigned i, const std::string &name, unsigned address) {
    chip[i].kind = name.empty() ? &emul_kinds[0] : emul_kind(name.c_str());
    present[i] = chip[i].kind != nullptr;
    const unsigned usual = chip[i].kind->address;
    chip[i].address = static_cast<uint8_t>(address != 0 ? address : i % 2 == 0 ? usual : usual == 0x6B ? 0x6A : 0x69);
    emul_power_on(&chip[i], 1.0, now_us, 250.0);
}

void hold_bus(unsigned i) {
    holds[i] = true;
}

void hang_bus(unsigned bus) {
    hung[bus] = true;
    hangs = true;
}

void tie_low(unsigned bus, bool low) {
    tied_low[bus] = low;
}

void wire_to(std::istream &pins) {
    pins >> wired[0].sda >> wired[0].scl;
}

void set_world(unsigned i, std::istream &counts) {
    for (int16_t &value : world[i]) {
        counts >> value;
    }
}
