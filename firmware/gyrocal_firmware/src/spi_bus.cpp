#include "spi_bus.h"

#include "board.h"

#if defined(GYROCAL_SPI_CS)

#include <Arduino.h>
#include <SPI.h>
#include <string.h>

#define LONGEST_OUT 32u

static const int selects[] = {GYROCAL_SPI_CS, GYROCAL_SPI_CS2};

void SpiBus::begin() {
    for (const int pin : selects) {
        if (pin >= 0) {
            pinMode(pin, OUTPUT);
            digitalWrite(pin, HIGH);
        }
    }
    SPI.begin(GYROCAL_SPI_SCK, GYROCAL_SPI_MISO, GYROCAL_SPI_MOSI, -1);
}

int SpiBus::transfer(unsigned die, const gc_spi_t &how, const uint8_t *out, size_t n_out, uint8_t *in, size_t n_in) {
    static const uint8_t modes[] = {SPI_MODE0, SPI_MODE1, SPI_MODE2, SPI_MODE3};
    uint8_t bytes[LONGEST_OUT]; /* they are received where they were sent from */
    if (selects[die] < 0 || n_out > sizeof bytes) {
        return -1;
    }
    memcpy(bytes, out, n_out);
    SPI.beginTransaction(SPISettings(how.most_hz < GYROCAL_SPI_HZ ? how.most_hz : GYROCAL_SPI_HZ, MSBFIRST, modes[how.mode]));
    digitalWrite(selects[die], LOW);
    SPI.transfer(bytes, n_out);
    if (n_in > 0) {
        memset(in, 0, n_in);
        SPI.transfer(in, n_in);
    }
    digitalWrite(selects[die], HIGH);
    SPI.endTransaction();
    return 0;
}

#endif
