#ifndef SPI_H
#define SPI_H

#include "Arduino.h"

#define MSBFIRST 1
#define SPI_MODE0 0
#define SPI_MODE1 1
#define SPI_MODE2 2
#define SPI_MODE3 3

class SPISettings {
public:
    SPISettings(uint32_t clock, uint8_t order, uint8_t mode) : clock_(clock), order_(order), mode_(mode) {}
    uint32_t clock_;
    uint8_t order_, mode_;
};

class SPIClass {
public:
    bool begin(int8_t sck = -1, int8_t miso = -1, int8_t mosi = -1, int8_t ss = -1);
    void beginTransaction(SPISettings settings);
    void endTransaction();
    void transfer(void *data, uint32_t n);
};

extern SPIClass SPI;

#endif
