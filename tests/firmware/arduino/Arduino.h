/* The declarations of Arduino-ESP32 2.0.14 that the port uses, so that `make test` type-checks it without PlatformIO's
   registry. Written by hand; the port has also been compiled against the real headers (docs/board.md). */
#ifndef ARDUINO_H
#define ARDUINO_H

#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include "freertos/FreeRTOS.h"

#define LOW 0x0
#define HIGH 0x1
#define INPUT 0x01
#define OUTPUT 0x03
#define PULLUP 0x04
#define INPUT_PULLUP 0x05
#define OUTPUT_OPEN_DRAIN 0x13
#define RISING 0x01
#define IRAM_ATTR

extern "C" {
void pinMode(uint8_t pin, uint8_t mode);
void digitalWrite(uint8_t pin, uint8_t value);
int digitalRead(uint8_t pin);
void attachInterruptArg(uint8_t pin, void (*handler)(void *), void *argument, int mode);
unsigned long micros();
unsigned long millis();
void delay(uint32_t ms);
void delayMicroseconds(uint32_t us);
void neopixelWrite(uint8_t pin, uint8_t red, uint8_t green, uint8_t blue);
}

class Print {
public:
    virtual size_t write(const uint8_t *buffer, size_t size) = 0;
    virtual int availableForWrite() { return 0; } /* 0: it does not tell, and a write may wait */
    size_t print(const char *text);
    size_t print(double value, int digits = 2);
    size_t println(const char *text);
    size_t println(double value, int digits = 2);
};

class Stream : public Print {
public:
    virtual int available() = 0;
    virtual int read() = 0;
    size_t readBytes(char *buffer, size_t length);
};

class HardwareSerial : public Stream {
public:
    void begin(unsigned long baud);
    size_t setRxBufferSize(size_t size);
    size_t setTxBufferSize(size_t size);
    int available() override;
    int read() override;
    int availableForWrite() override;
    void flush();
    size_t write(const uint8_t *buffer, size_t size) override;
};

/* The native USB connector of an ESP32-S3 or -C3. */
class HWCDC : public Stream {
public:
    void begin(unsigned long baud = 0);
    size_t setRxBufferSize(size_t size);
    size_t setTxBufferSize(size_t size);
    int available() override;
    int read() override;
    int availableForWrite() override;
    void flush();
    size_t write(const uint8_t *buffer, size_t size) override;
};

#if ARDUINO_USB_CDC_ON_BOOT
extern HWCDC Serial;
#else
extern HardwareSerial Serial;
#endif

class EspClass {
public:
    void restart();
};

extern EspClass ESP;

#endif
