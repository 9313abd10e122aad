/* The device for C++17: a port is a class with these members, of which the last five may be left out; one by SPI has
 * `spi` in place of the first two.
 *
 *     struct Board {
 *         bool write(uint8_t address, uint8_t reg, const uint8_t *data, size_t n);
 *         bool read(uint8_t address, uint8_t reg, uint8_t *data, size_t n);
 *         bool spi(unsigned die, const gc_spi_t &how, const uint8_t *out, size_t n_out, uint8_t *in, size_t n_in); // gc_port.h
 *         uint64_t now_us();
 *         void wait_until_us(uint64_t t_us);
 *         bool send(std::string_view text);                          // takes all of it, or none and returns false
 *         bool store(const char *key, const void *data, size_t n);
 *         int load(const char *key, void *data, size_t n);           // bytes, or a negative number
 *         void led(gc_led_t state);
 *         uint64_t wait_ready_us(uint64_t deadline_us);              // gc_port.h
 *         void restart();
 *     };
 *
 *     Board board;
 *     gyrocal::Device device(board);
 *     device.begin();                       // finds the sensor
 *     for (;;) {
 *         device.receive(bytes);
 *         device.step();
 *     }
 */
#ifndef GYROCAL_HPP
#define GYROCAL_HPP

#include "gc_device.h"
#include "gc_error.h"
#include "gc_parts.h"
#include "headers.h" /* the calibration and the network that were exported with this library */

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <type_traits>
#include <utility>

namespace gyrocal {

namespace detail {
template <typename B, typename = void> struct has_spi : std::false_type {};
template <typename B>
struct has_spi<B, std::void_t<decltype(std::declval<B &>().spi(0u, std::declval<const gc_spi_t &>(), nullptr, size_t{}, nullptr,
                                                              size_t{}))>> : std::true_type {};
template <typename B, typename = void> struct has_store : std::false_type {};
template <typename B>
struct has_store<B, std::void_t<decltype(std::declval<B &>().store("", nullptr, size_t{})),
                                decltype(std::declval<B &>().load("", nullptr, size_t{}))>> : std::true_type {};
template <typename B, typename = void> struct has_led : std::false_type {};
template <typename B> struct has_led<B, std::void_t<decltype(std::declval<B &>().led(GC_LED_IDLE))>> : std::true_type {};
template <typename B, typename = void> struct has_ready : std::false_type {};
template <typename B>
struct has_ready<B, std::void_t<decltype(std::declval<B &>().wait_ready_us(uint64_t{}))>> : std::true_type {};
template <typename B, typename = void> struct has_restart : std::false_type {};
template <typename B> struct has_restart<B, std::void_t<decltype(std::declval<B &>().restart())>> : std::true_type {};
} // namespace detail

/* One sensor. It must stay where it is, and the board must outlive it. */
template <typename Board> class Device {
public:
    explicit Device(Board &board) : port_(), config_(), device_() {
        port_.context = &board;
        if constexpr (detail::has_spi<Board>::value) {
            port_.spi = [](void *context, unsigned die, const gc_spi_t *how, const uint8_t *out, size_t n_out, uint8_t *in, size_t n_in) {
                return of(context).spi(die, *how, out, n_out, in, n_in) ? 0 : -1;
            };
        } else {
            port_.bus_write = [](void *context, uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
                return of(context).write(address, reg, data, n) ? static_cast<int>(n) : -1;
            };
            port_.bus_read = [](void *context, uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
                return of(context).read(address, reg, data, n) ? static_cast<int>(n) : -1;
            };
        }
        port_.now_us = [](void *context) -> uint64_t { return of(context).now_us(); };
        port_.wait_until_us = [](void *context, uint64_t t_us) { of(context).wait_until_us(t_us); };
        port_.send = [](void *context, const char *data, size_t n) {
            return of(context).send(std::string_view(data, n)) ? static_cast<int>(n) : -1;
        };
        port_.part_file = [](void *, const char *, size_t *n) -> const uint8_t * {
            *n = gyrocal_part_file_bytes;
            return gyrocal_part_file;
        };
        if constexpr (detail::has_store<Board>::value) {
            port_.store = [](void *context, const char *key, const void *data, size_t n) {
                return of(context).store(key, data, n) ? 0 : -1;
            };
            port_.load = [](void *context, const char *key, void *data, size_t n) -> int { return of(context).load(key, data, n); };
        }
        if constexpr (detail::has_led<Board>::value) {
            port_.led = [](void *context, gc_led_t state) { of(context).led(state); };
        }
        if constexpr (detail::has_ready<Board>::value) {
            port_.wait_ready_us = [](void *context, uint64_t deadline_us) -> uint64_t {
                return of(context).wait_ready_us(deadline_us);
            };
        }
        if constexpr (detail::has_restart<Board>::value) {
            port_.restart = [](void *context) { of(context).restart(); };
        }
    }
    Device(const Device &) = delete;
    Device &operator=(const Device &) = delete;

    /* Takes the first sensor that answers. Without one, bus_nack is reported until one does. */
    void begin() {
        const gc_part_t *found = nullptr;
        begin(gc_part_look(gc_parts, &port_, &found));
    }
    void begin(uint8_t address) {
        config_.port = &port_;
        config_.parts = gc_parts;
        config_.address = address;
        config_.calibration = gyrocal_calibration;
        config_.net = gyrocal_net;
        gc_device_init(&device_, &config_);
    }

    void receive(std::string_view bytes) { gc_device_receive(&device_, bytes.data(), bytes.size()); }
    void step() { gc_device_step(&device_); }
    const gc_device_t &state() const { return device_; }
    const gc_port_t &port() const { return port_; }

private:
    static Board &of(void *context) { return *static_cast<Board *>(context); }

    gc_port_t port_;
    gc_device_config_t config_;
    gc_device_t device_;
};

} // namespace gyrocal

#endif
