#ifndef WIRE_H
#define WIRE_H

#include "Arduino.h"

class TwoWire {
public:
    bool begin();
    bool setClock(uint32_t frequency);
    bool begin(int sda, int scl, uint32_t frequency = 0);
    bool end();
    void setTimeOut(uint16_t timeout_ms);
    void beginTransmission(uint8_t address);
    uint8_t endTransmission(bool stop = true);
    size_t requestFrom(uint8_t address, size_t length, bool stop);
    size_t write(uint8_t data);
    size_t write(const uint8_t *data, size_t length);
    int read();
};

extern TwoWire Wire;
extern TwoWire Wire1;

#endif
