/* Sensor 0 by SPI: its chip select is pin 5, that of its second die pin 4. */
#include "SPI.h"
#include "simulated_board.h"

#include <cstring>
#include <vector>

#define DIES 2

static const int select_pins[DIES] = {5, 4};
static bool started, in_transaction;
static bool is_low[DIES];
static uint32_t clock_hz;
static uint8_t mode;
static std::vector<uint8_t> sent; /* since a chip select went low */
static bool received;

SPIClass SPI;

bool SPIClass::begin(int8_t, int8_t, int8_t, int8_t) {
    started = true;
    return true;
}

void SPIClass::beginTransaction(SPISettings settings) {
    in_transaction = settings.order_ == MSBFIRST;
    clock_hz = settings.clock_;
    mode = settings.mode_;
}

void SPIClass::endTransaction() {
    in_transaction = false;
}

static unsigned selected() {
    return is_low[0] && !is_low[1] ? 0u : is_low[1] && !is_low[0] ? 1u : DIES;
}

/* What was sent first asks for what is sent and received then. */
void SPIClass::transfer(void *data, uint32_t n) {
    uint8_t *bytes = static_cast<uint8_t *>(data);
    pass(8e6 / clock_hz * n);
    if (!started || !in_transaction) {
        return;
    }
    if (sent.empty()) {
        sent.assign(bytes, bytes + n);
        memset(bytes, 0xFF, n);
    } else {
        received = true;
        pass_by_spi(selected(), mode, clock_hz, sent.data(), sent.size(), bytes, n);
    }
}

void turn_select(int pin, bool high) {
    for (unsigned die = 0; die < DIES; die++) {
        if (pin != select_pins[die]) {
            continue;
        }
        if (high && is_low[die] && !received && !sent.empty()) {
            pass_by_spi(die, mode, clock_hz, sent.data(), sent.size(), nullptr, 0);
        }
        is_low[die] = !high;
        sent.clear();
        received = false;
    }
}
