/* An I2C bus at 400 kHz. Transfers have a timeout, and nine clock pulses free a bus whose data line a part holds low. */
#ifndef I2C_BUS_H
#define I2C_BUS_H

#include <Wire.h>
#include <freertos/FreeRTOS.h>
#include <freertos/semphr.h>

class I2cBus {
public:
    I2cBus(unsigned number, TwoWire &wire, int sda, int scl);
    void begin();
    unsigned number() const { return number_; }
    bool answers(uint8_t address);
    /* The functions of gc_port.h. They may be called from any task. */
    int write(uint8_t address, uint8_t reg, const uint8_t *data, size_t n);
    int read(uint8_t address, uint8_t reg, uint8_t *data, size_t n);

private:
    void start();
    void recover();
    void clock_free();

    unsigned number_;
    TwoWire &wire_;
    int sda_, scl_;
    SemaphoreHandle_t mutex_;
    uint32_t recovered_ms_;
};

#endif
