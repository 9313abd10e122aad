#include "i2c_bus.h"

#include "output.h"

#include <Arduino.h>

#define CLOCK_HZ 400000u
#define TIMEOUT_MS 10 /* a sample takes 0.4, a burst of the FIFO, 112 bytes, 2.6 */
#define RECOVER_EVERY_MS 100u
#define HALF_CLOCK_US 5u

namespace {
class Lock {
public:
    explicit Lock(SemaphoreHandle_t mutex) : mutex_(mutex) { xSemaphoreTake(mutex_, portMAX_DELAY); }
    ~Lock() { xSemaphoreGive(mutex_); }

private:
    SemaphoreHandle_t mutex_;
};
} // namespace

I2cBus::I2cBus(unsigned number, TwoWire &wire, int sda, int scl)
    : number_(number), wire_(wire), sda_(sda), scl_(scl), mutex_(xSemaphoreCreateMutex()), recovered_ms_(0) {
    configASSERT(mutex_ != nullptr);
}

/* The board may have restarted during a transfer. */
void I2cBus::begin() {
    clock_free();
    start();
}

void I2cBus::start() {
    if (!wire_.begin(sda_, scl_, CLOCK_HZ)) {
        output_say("bus %u cannot be started at SDA %d, SCL %d: check GYROCAL_SDA and GYROCAL_SCL", number_, sda_, scl_);
    }
    wire_.setTimeOut(TIMEOUT_MS);
}

bool I2cBus::answers(uint8_t address) {
    Lock lock(mutex_);
    wire_.beginTransmission(address);
    return wire_.endTransmission() == 0;
}

int I2cBus::write(uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
    Lock lock(mutex_);
    wire_.beginTransmission(address);
    wire_.write(reg);
    wire_.write(data, n);
    if (wire_.endTransmission() != 0) {
        recover();
        return -1;
    }
    return static_cast<int>(n);
}

int I2cBus::read(uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
    Lock lock(mutex_);
    wire_.beginTransmission(address);
    wire_.write(reg);
    wire_.endTransmission(false); /* sends nothing yet: requestFrom sends both, and its count shows errors */
    const size_t got = wire_.requestFrom(address, n, true);
    for (size_t i = 0; i < got && i < n; i++) {
        data[i] = static_cast<uint8_t>(wire_.read());
    }
    if (got == 0) {
        recover();
        return -1;
    }
    return static_cast<int>(got);
}

void I2cBus::recover() {
    if (millis() - recovered_ms_ < RECOVER_EVERY_MS) {
        return;
    }
    recovered_ms_ = millis();
    wire_.end();
    clock_free();
    start();
}

/* A part that was interrupted during a byte holds SDA low until it has sent the remaining bits. */
void I2cBus::clock_free() {
    pinMode(sda_, INPUT_PULLUP);
    pinMode(scl_, OUTPUT_OPEN_DRAIN | PULLUP);
    for (int i = 0; i < 9; i++) {
        digitalWrite(scl_, LOW);
        delayMicroseconds(HALF_CLOCK_US);
        digitalWrite(scl_, HIGH);
        delayMicroseconds(HALF_CLOCK_US);
    }
    pinMode(sda_, OUTPUT_OPEN_DRAIN | PULLUP); /* stop condition: SDA rises while SCL is high */
    digitalWrite(sda_, LOW);
    delayMicroseconds(HALF_CLOCK_US);
    digitalWrite(sda_, HIGH);
    delayMicroseconds(HALF_CLOCK_US);
}
