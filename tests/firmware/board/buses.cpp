/* Four sensors on two buses, the interrupt pin of the first, and the pins of the light. */
#include "Wire.h"
#include "simulated_board.h"

extern "C" {
#include "emul_lsm6dso.h"
}

#include <cmath>
#include <cstdio>
#include <cstring>
#include <deque>
#include <istream>
#include <vector>

#define I2C_BIT_US 2.5
#define NOISE_COUNTS 5.0

static emul_lsm6dso_t chip[CHIPS];
static bool present[CHIPS], holds[CHIPS];
static int16_t world[CHIPS][EMUL_WORDS];
static int clocks[2]; /* of a bus that nobody drives but the pins */
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
    while (present[i] && chip[i].tick_us > before_us && chip[i].tick_us <= static_cast<double>(t_us)) {
        before_us = chip[i].tick_us;
        memcpy(chip[i].world, world[i], sizeof world[i]);
        for (int axis = 1; axis <= 3; axis++) {
            chip[i].world[axis] = static_cast<int16_t>(std::lround(world[i][axis] + NOISE_COUNTS * gaussian()));
        }
        emul_lsm6dso_advance(&chip[i], static_cast<uint64_t>(before_us) + 1u);
    }
}

uint64_t next_edge_us() {
    return int1.handler != nullptr && chip[0].tick_us > 0.0 && chip[0].tick_us > static_cast<double>(now_us)
               ? static_cast<uint64_t>(chip[0].tick_us) + 1u
               : NEVER;
}

void look_at_pins() {
    if (int1.handler == nullptr) {
        return;
    }
    advance(0, now_us);
    const bool high = emul_lsm6dso_int1(&chip[0]);
    const bool rose = high && !int1.high;
    int1.high = high;
    if (rose) {
        int1.handler(int1.argument);
    }
}

static int bus_of(const TwoWire *wire) {
    return wire == &Wire ? 0 : 1;
}

static int chip_at(const TwoWire *wire, uint8_t address) {
    const int i = 2 * bus_of(wire) + (address == 0x6B ? 0 : 1);
    const bool held = holds[2 * bus_of(wire)] || holds[2 * bus_of(wire) + 1];
    return (address == 0x6A || address == 0x6B) && present[i] && !held ? i : -1;
}

TwoWire Wire, Wire1;
static struct {
    uint8_t address;
    std::vector<uint8_t> sent;
    bool stop_due;
    std::deque<uint8_t> got;
} transfer[2];

bool TwoWire::begin(int, int, uint32_t frequency) {
    clocks[bus_of(this)] = 0;
    return frequency == 400000 && fails.count("wire") == 0;
}

bool TwoWire::end() {
    return true;
}

void TwoWire::setTimeOut(uint16_t) {
}

void TwoWire::beginTransmission(uint8_t address) {
    transfer[bus_of(this)].address = address;
    transfer[bus_of(this)].sent.clear();
}

size_t TwoWire::write(uint8_t data) {
    return write(&data, 1);
}

size_t TwoWire::write(const uint8_t *data, size_t n) {
    std::vector<uint8_t> &sent = transfer[bus_of(this)].sent;
    sent.insert(sent.end(), data, data + n);
    return n;
}

/* Without a stop it does no bus work: the reading that follows does. */
uint8_t TwoWire::endTransmission(bool stop) {
    auto &t = transfer[bus_of(this)];
    if (!stop) {
        return 0;
    }
    pass(I2C_BIT_US * (9.0 * static_cast<double>(t.sent.size() + 1u) + 2.0));
    const int i = chip_at(this, t.address);
    if (i < 0) {
        return 2;
    }
    advance(i, now_us);
    if (!t.sent.empty()) {
        emul_lsm6dso_write(&chip[i], now_us, t.sent[0], t.sent.data() + 1, t.sent.size() - 1);
    }
    return 0;
}

size_t TwoWire::requestFrom(uint8_t address, size_t n, bool) {
    auto &t = transfer[bus_of(this)];
    uint8_t data[128];
    t.got.clear();
    if (n > sizeof data) {
        return 0; /* as the real one's buffer */
    }
    pass(I2C_BIT_US * (9.0 * static_cast<double>(n + 3u) + 3.0));
    const int i = chip_at(this, address);
    if (i < 0) {
        return 0;
    }
    advance(i, now_us);
    const int got = emul_lsm6dso_read(&chip[i], now_us, t.sent[0], data, n);
    t.got.insert(t.got.end(), data, data + (got > 0 ? got : 0));
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
    if (pin == GYROCAL_SCL || pin == GYROCAL_SCL2) {
        const int bus = pin == GYROCAL_SCL ? 0 : 1;
        clocks[bus] += value == HIGH ? 1 : 0;
        if (clocks[bus] == 9) {
            holds[2 * bus] = holds[2 * bus + 1] = false;
        }
    }
}

int digitalRead(uint8_t) {
    advance(0, now_us);
    return emul_lsm6dso_int1(&chip[0]) ? HIGH : LOW;
}

void attachInterruptArg(uint8_t, void (*handler)(void *), void *argument, int) {
    int1.handler = handler;
    int1.argument = argument;
}

void neopixelWrite(uint8_t, uint8_t red, uint8_t green, uint8_t blue) {
    printf("# light %.3f %d %d %d\n", 1e-6 * static_cast<double>(now_us), red, green, blue);
}
}

void power_on(unsigned i) {
    present[i] = true;
    emul_lsm6dso_power_on(&chip[i], now_us, 250.0);
}

void hold_bus(unsigned i) {
    holds[i] = true;
}

void set_world(unsigned i, std::istream &counts) {
    for (int16_t &value : world[i]) {
        counts >> value;
    }
}
