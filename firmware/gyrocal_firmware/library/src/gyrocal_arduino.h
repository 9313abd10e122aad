/* The functions of gc_port.h by Arduino's Wire or SPI, Print and clock, for one sensor and any board. Nothing survives power-off with it;
   the ESP32 firmware of gyrocal has a port that does better. */
#ifndef GYROCAL_ARDUINO_H
#define GYROCAL_ARDUINO_H

#include "gc_device.h"
#include "gc_error.h"
#include "gc_parts.h"
#include "headers.h" /* the calibration and the network that were exported with this library */

#include <Arduino.h>
#include <SPI.h>
#include <Wire.h>
#include <string.h>

#define GYROCAL_SPI_HZ 8000000 /* the fastest clock of SPI; slower where the wires are long */
#define GYROCAL_OUT_BYTES 2048 /* sentences that wait for the wire, or for somebody who reads it */
#define GYROCAL_KEPT_FREE_BYTES 1024 /* of them, for answers to commands while samples fill the wire */

class GyrocalPort {
public:
    /* out receives the device's sentences; nullptr: nobody reads them. */
    explicit GyrocalPort(TwoWire &wire, Print *out = nullptr) : GyrocalPort(&wire, nullptr, -1, -1, out) {
        port_.bus_write = write;
        port_.bus_read = read;
    }

    /* By SPI, with the sensor's chip select at the pin cs; a BMI088's accelerometer has one more. */
    GyrocalPort(SPIClass &spi, int cs, Print *out = nullptr, int cs_accelerometer = -1)
        : GyrocalPort(nullptr, &spi, cs, cs_accelerometer, out) {
        port_.spi = transfer;
    }

    /* After SPI.begin(). */
    void begin_selects() const {
        for (const int cs : select_) {
            if (cs >= 0) {
                pinMode(static_cast<uint8_t>(cs), OUTPUT);
                digitalWrite(static_cast<uint8_t>(cs), HIGH);
            }
        }
    }

    const gc_port_t *port() const { return &port_; }

    /* Finds a sensor that the library knows. Returns its address, or 0 if there is none; part may be nullptr. */
    uint8_t find(const gc_part_t **part) const {
        const gc_part_t *found = nullptr;
        const uint8_t address = gc_part_look(gc_parts, &port_, &found);
        if (part != nullptr && found != nullptr) {
            *part = found;
        }
        return found != nullptr ? address : 0;
    }

private:
    GyrocalPort(TwoWire *wire, SPIClass *spi, int cs, int other_cs, Print *out)
        : wire_(wire), spi_(spi), select_{cs, other_cs}, out_(out), port_(), high_us_(0), last_us_(0), text_(), from_(0), held_(0),
          tells_room_(false) {
        port_.context = this;
        port_.now_us = now_us;
        port_.wait_until_us = wait_until_us;
        port_.send = send;
        port_.part_file = part_file;
    }

    static GyrocalPort &of(void *context) { return *static_cast<GyrocalPort *>(context); }

    static int write(void *context, uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
        TwoWire &wire = *of(context).wire_;
        wire.beginTransmission(address);
        wire.write(reg);
        wire.write(data, n);
        return wire.endTransmission() == 0 ? static_cast<int>(n) : -1;
    }

    static int read(void *context, uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
        TwoWire &wire = *of(context).wire_;
        wire.beginTransmission(address);
        wire.write(reg);
        if (wire.endTransmission(false) != 0) {
            return -1;
        }
        const size_t got = wire.requestFrom(address, static_cast<uint8_t>(n), static_cast<uint8_t>(1));
        for (size_t i = 0; i < got && i < n; i++) {
            data[i] = static_cast<uint8_t>(wire.read());
        }
        return got > 0 ? static_cast<int>(got) : -1;
    }

    static int transfer(void *context, unsigned die, const gc_spi_t *how, const uint8_t *out, size_t n_out, uint8_t *in, size_t n_in) {
        static const uint8_t modes[] = {SPI_MODE0, SPI_MODE1, SPI_MODE2, SPI_MODE3};
        SPIClass &spi = *of(context).spi_;
        const int cs = of(context).select_[die];
        uint8_t bytes[GC_WRITE_MAX + 1u]; /* they are received where they were sent from */
        if (cs < 0 || n_out > sizeof bytes) {
            return -1;
        }
        memcpy(bytes, out, n_out);
        spi.beginTransaction(SPISettings(how->most_hz < GYROCAL_SPI_HZ ? how->most_hz : GYROCAL_SPI_HZ, MSBFIRST, modes[how->mode]));
        digitalWrite(static_cast<uint8_t>(cs), LOW);
        spi.transfer(bytes, n_out);
        if (n_in > 0) {
            memset(in, 0, n_in);
            spi.transfer(in, n_in);
        }
        digitalWrite(static_cast<uint8_t>(cs), HIGH);
        spi.endTransaction();
        return 0;
    }

    /* micros() begins anew after 71 minutes. */
    static uint64_t now_us(void *context) {
        GyrocalPort &self = of(context);
        const uint32_t us = static_cast<uint32_t>(micros());
        self.high_us_ += us < self.last_us_ ? 4294967296ULL : 0ULL;
        self.last_us_ = us;
        return self.high_us_ + us;
    }

    static void wait_until_us(void *context, uint64_t t_us) {
        of(context).write_held();
        uint64_t now = now_us(context);
        while (now < t_us) {
            of(context).write_held();
            if (t_us - now > 2000u) {
                delay(1);
            }
            now = now_us(context);
        }
    }

    /* Writes as much as there is room for. A Print that has never told of room does not tell: it is written to, and may wait. */
    void write_held() {
        while (held_ > 0) {
            const int told = out_->availableForWrite();
            tells_room_ = tells_room_ || told > 0;
            const size_t whole = held_ < GYROCAL_OUT_BYTES - from_ ? held_ : GYROCAL_OUT_BYTES - from_;
            const size_t room = !tells_room_ ? whole : told > 0 ? static_cast<size_t>(told) : 0;
            const size_t part = whole < room ? whole : room;
            const size_t done = part > 0 ? out_->write(text_ + from_, part) : 0;
            from_ = (from_ + done) % GYROCAL_OUT_BYTES;
            held_ -= done;
            if (done == 0) {
                return;
            }
        }
    }

    static int send(void *context, const char *data, size_t n) {
        GyrocalPort &self = of(context);
        if (self.out_ == nullptr) {
            return static_cast<int>(n);
        }
        const size_t needed = gc_wire_is_sample(data, n) ? n + GYROCAL_KEPT_FREE_BYTES : n;
        if (needed > GYROCAL_OUT_BYTES - self.held_) {
            return 0;
        }
        for (size_t i = 0; i < n; i++) {
            self.text_[(self.from_ + self.held_++) % GYROCAL_OUT_BYTES] = static_cast<uint8_t>(data[i]);
        }
        self.write_held();
        return static_cast<int>(n);
    }

    static const uint8_t *part_file(void *, const char *, size_t *n) {
        *n = gyrocal_part_file_bytes;
        return gyrocal_part_file;
    }

    TwoWire *wire_;
    SPIClass *spi_;
    const int select_[2]; /* pins; -1 = there is none */
    Print *out_;
    gc_port_t port_;
    uint64_t high_us_;
    uint32_t last_us_;
    uint8_t text_[GYROCAL_OUT_BYTES]; /* a ring */
    size_t from_, held_;
    bool tells_room_;
};

#endif
