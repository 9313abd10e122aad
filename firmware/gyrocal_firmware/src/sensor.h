/* One sensor on this board. Each sensor runs the core's device in a separate task. */
#ifndef SENSOR_H
#define SENSOR_H

#include "flash_store.h"
#include "gc_device.h"
#include "i2c_bus.h"

#include <esp_timer.h>
#include <freertos/FreeRTOS.h>
#include <freertos/stream_buffer.h>
#include <freertos/task.h>

class Sensor {
public:
    /* bus is null for a sensor by SPI; pin_int1 is -1 if INT1 is not wired. */
    Sensor(I2cBus *bus, uint8_t address, unsigned imu, int pin_int1);
    void start();
    uint8_t address() const { return address_; }
    /* What its task was about when it was last seen. */
    bool is_set_up() const { return device_.sampler.ready; }
    bool is_recording() const { return gc_device_is_recording(&device_); }
    /* Whether samples are lost while the board writes its flash, because the part does not keep them. */
    bool is_disturbed_by_flash() const { return is_recording() && device_.settings.now.fifo == 0.0; }
    /* Accepts bytes of commands as they arrive. Bytes that do not fit into the buffer are lost. */
    void hear(const char *data, size_t n);

private:
    static void run(void *self);
    static void on_data_ready(void *self);
    void wait(uint64_t t_us);
    uint64_t rose_us() const;

    I2cBus *bus_;
    uint8_t address_;
    unsigned imu_;
    int pin_int1_;
    FlashStore flash_;
    gc_port_t port_;
    gc_device_config_t config_;
    gc_device_t device_;
    esp_timer_handle_t alarm_;
    TaskHandle_t task_;
    StreamBufferHandle_t commands_;
    uint64_t had_bus_us_;      /* of the last reading */
    volatile uint64_t rose_us_; /* when INT1 last rose */

    static Sensor *first_;
    Sensor *next_; /* all sensors of the board, to the one that was made first */

    friend struct Port;
};

#endif
