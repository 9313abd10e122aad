#include "i2c_bus.h"

#include "board.h"
#include "output.h"

#include <Arduino.h>
#include <esp_timer.h>

#define BURST_BITS (115 * 9) /* of the FIFO: 112 bytes, both addresses and the register */
#define TIMEOUT_MS (4 * 1000 * BURST_BITS / GYROCAL_I2C_HZ)
#define RECOVER_EVERY_MS 100u
#define HALF_CLOCK_US 5u
#define LOOKS 20 /* at lines that should rise, 1 us apart */

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
    : number_(number), wire_(wire), sda_(sda), scl_(scl), mutex_(xSemaphoreCreateMutex()), started_(false), told_(false),
      recovered_ms_(0) {
    configASSERT(mutex_ != nullptr);
}

/* The board may have restarted during a transfer. */
void I2cBus::begin() {
    clock_free();
    start();
}

void I2cBus::start() {
    started_ = wire_.begin(sda_, scl_, GYROCAL_I2C_HZ);
    wire_.setTimeOut(TIMEOUT_MS);
}

void I2cBus::move(int sda, int scl) {
    Lock lock(mutex_);
    wire_.end();
    sda_ = sda;
    scl_ = scl;
    begin();
}

/* On a bus that was not started, Wire never gives its lock back (Wire.cpp of Arduino-ESP32 2.0.14). On a bus with a low line, the
   driver waits 1 s for an event, whatever the timeout (i2c.c of ESP-IDF 4.4). Neither may be tried. */
bool I2cBus::can_transfer() {
    for (int look = 0; started_ && look < LOOKS; look++) {
        if (digitalRead(sda_) == HIGH && digitalRead(scl_) == HIGH) {
            return true;
        }
        delayMicroseconds(1);
    }
    return false;
}

void I2cBus::tell_trouble() {
    const bool trouble = !can_transfer();
    if (trouble && !told_ && !started_) {
        output_say("bus %u cannot be started at SDA %d, SCL %d: check GYROCAL_SDA and GYROCAL_SCL", number_, sda_, scl_);
    } else if (trouble && !told_) {
        const bool is_sda = digitalRead(sda_) == LOW;
        output_say("bus %u: %s %d stays low: check the wiring, and that the sensor has 3.3 V", number_, is_sda ? "SDA" : "SCL",
                   is_sda ? sda_ : scl_);
    }
    told_ = trouble;
}

bool I2cBus::answers(uint8_t address) {
    Lock lock(mutex_);
    if (!can_transfer()) {
        return false;
    }
    wire_.beginTransmission(address);
    return wire_.endTransmission() == 0;
}

int I2cBus::write(uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
    Lock lock(mutex_);
    if (!can_transfer()) {
        recover();
        return -1;
    }
    wire_.beginTransmission(address);
    wire_.write(reg);
    wire_.write(data, n);
    if (wire_.endTransmission() != 0) {
        recover();
        return -1;
    }
    return static_cast<int>(n);
}

int I2cBus::read(uint8_t address, uint8_t reg, uint8_t *data, size_t n, uint64_t &had_bus_us) {
    Lock lock(mutex_);
    had_bus_us = static_cast<uint64_t>(esp_timer_get_time());
    if (!can_transfer()) {
        recover();
        return -1;
    }
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
    tell_trouble();
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
