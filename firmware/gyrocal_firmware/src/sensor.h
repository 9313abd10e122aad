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
    /* pin_int1 is -1 if INT1 is not wired. */
    Sensor(I2cBus &bus, uint8_t address, unsigned imu, int pin_int1);
    void start();
    /* Accepts bytes of commands as they arrive. Bytes that do not fit into the buffer are lost. */
    void hear(const char *data, size_t n);

private:
    static void run(void *self);
    static void on_data_ready(void *self);
    void wait(uint64_t t_us);

    I2cBus &bus_;
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

    friend struct Port;
};

#endif
