/* An I2C bus. Nothing is sent while a line is low, and nine clock pulses free a bus whose data line a part holds. */
#ifndef I2C_BUS_H
#define I2C_BUS_H

#include <Wire.h>
#include <freertos/FreeRTOS.h>
#include <freertos/semphr.h>

class I2cBus {
public:
    I2cBus(unsigned number, TwoWire &wire, int sda, int scl);
    void begin();
    void move(int sda, int scl);
    /* Says what keeps the bus from working, once until it works again. */
    void tell_trouble();
    unsigned number() const { return number_; }
    bool answers(uint8_t address);
    /* The functions of gc_port.h. They may be called from any task. */
    int write(uint8_t address, uint8_t reg, const uint8_t *data, size_t n);
    /* had_bus_us receives the time at which the transfer had the bus. */
    int read(uint8_t address, uint8_t reg, uint8_t *data, size_t n, uint64_t &had_bus_us);

private:
    void start();
    bool can_transfer();
    void recover();
    void clock_free();

    unsigned number_;
    TwoWire &wire_;
    int sda_, scl_;
    SemaphoreHandle_t mutex_;
    bool started_, told_;
    uint32_t recovered_ms_;
};

#endif
