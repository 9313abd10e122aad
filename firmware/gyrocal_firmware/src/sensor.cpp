#include "sensor.h"

#include "headers.h"
#include "output.h"
#include "part.h"
#include "spi_bus.h"
#include "status_led.h"
#include "wireless.h"

#include <Arduino.h>
#include <esp_system.h>
#include <esp_task_wdt.h>

#define STACK_BYTES 12288 /* the core takes 4 kB of it (docs/cpus.md) */
#define PRIORITY 18      /* above all other tasks of this firmware, below the timers that wake it */
#define COMMAND_BYTES 512
#define SHORT_US 80u     /* waits shorter than this do not use a timer */
#define WAKE_EARLY_US 40u
#define RESTART_MS 100   /* until what was said is on the wire */
#define LATE_TICKS pdMS_TO_TICKS(20)

Sensor *Sensor::first_ = nullptr;

/* The callbacks of gc_port.h. Their context is the Sensor. */
struct Port {
    static Sensor &of(void *context) { return *static_cast<Sensor *>(context); }

    static int bus_write(void *context, uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
        return of(context).bus_->write(address, reg, data, n);
    }
    static int bus_read(void *context, uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
        return of(context).bus_->read(address, reg, data, n, of(context).had_bus_us_);
    }
#if defined(GYROCAL_SPI_CS)
    static int spi(void *, unsigned die, const gc_spi_t *how, const uint8_t *out, size_t n_out, uint8_t *in, size_t n_in) {
        return SpiBus::transfer(die, *how, out, n_out, in, n_in);
    }
#endif
    static uint64_t bus_us(void *context) { return of(context).had_bus_us_; }
    static uint64_t now_us(void *) { return static_cast<uint64_t>(esp_timer_get_time()); }
    static void wait_until_us(void *context, uint64_t t_us) { of(context).wait(t_us); }
    static uint64_t wait_ready_us(void *context, uint64_t deadline_us) {
        Sensor &sensor = of(context);
        uint64_t now = now_us(context);
        while (digitalRead(sensor.pin_int1_) == LOW && now < deadline_us) {
            ulTaskNotifyTake(pdTRUE, pdMS_TO_TICKS((deadline_us - now) / 1000u + 1u));
            now = now_us(context);
        }
        return sensor.rose_us();
    }
    static int send(void *, const char *data, size_t n) { return output_send(data, n); }
    static int store(void *context, const char *key, const void *data, size_t n) {
        return of(context).flash_.store(key, data, n);
    }
    static int load(void *context, const char *key, void *data, size_t n) { return of(context).flash_.load(key, data, n); }
    static bool may_store(void *context) {
        for (const Sensor *other = Sensor::first_; other != nullptr; other = other->next_) {
            if (other != context && other->is_disturbed_by_flash()) {
                return false;
            }
        }
        return true;
    }
    static void least_free(void *, uint32_t *heap_bytes, uint32_t *stack_bytes) {
        *heap_bytes = esp_get_minimum_free_heap_size();
        *stack_bytes = uxTaskGetStackHighWaterMark(nullptr); /* this FreeRTOS counts bytes */
    }
    static void restart(void *) {
        delay(RESTART_MS);
        ESP.restart();
    }
    static const uint8_t *part_file(void *, const char *, size_t *n) {
        *n = gyrocal_part_file_bytes;
        return gyrocal_part_file;
    }
    static void led(void *context, gc_led_t state) { status_led_set(of(context).imu_, state); }
    static void alarm(void *context) { xTaskNotifyGive(of(context).task_); }
};

Sensor::Sensor(I2cBus *bus, uint8_t address, unsigned imu, int pin_int1)
    : bus_(bus), address_(address), imu_(imu), pin_int1_(pin_int1), port_(), config_(), device_(), alarm_(nullptr), task_(nullptr),
      commands_(xStreamBufferCreate(COMMAND_BYTES, 1)), had_bus_us_(0), rose_us_(0), next_(first_) {
    first_ = this;
    port_.context = this;
#if defined(GYROCAL_SPI_CS)
    port_.spi = Port::spi;
#else
    port_.bus_write = Port::bus_write;
    port_.bus_read = Port::bus_read;
    port_.bus_us = Port::bus_us;
#endif
    port_.now_us = Port::now_us;
    port_.wait_until_us = Port::wait_until_us;
    port_.wait_ready_us = pin_int1 >= 0 ? Port::wait_ready_us : nullptr;
    port_.send = Port::send;
    port_.store = Port::store;
    port_.load = Port::load;
    port_.may_store = Port::may_store;
    port_.least_free = Port::least_free;
    port_.restart = Port::restart;
    port_.part_file = Port::part_file;
    port_.led = Port::led;
    port_.wifi = wifi_obey;
    port_.wifi_state = wifi_state;
    config_.port = &port_;
    config_.parts = PARTS;
    config_.address = address;
    config_.imu = imu;
    config_.calibration = gyrocal_calibration;
    config_.net = gyrocal_net;
}

/* A task that uses the FPU stays on the core on which it first did, so the core is chosen here: the timers run on core 0. */
void Sensor::start() {
    const BaseType_t core = portNUM_PROCESSORS - 1 - static_cast<BaseType_t>(imu_ % portNUM_PROCESSORS);
    esp_timer_create_args_t alarm = {};
    alarm.callback = Port::alarm;
    alarm.arg = this;
    alarm.name = "sample";
    ESP_ERROR_CHECK(esp_timer_create(&alarm, &alarm_));
    flash_.begin(bus_ != nullptr ? bus_->number() : 0, address_);
    if (commands_ == nullptr || xTaskCreatePinnedToCore(run, "sensor", STACK_BYTES, this, PRIORITY, &task_, core) != pdPASS) {
        output_say("sensor %u: no memory for its task: connect fewer sensors", imu_);
    }
}

void Sensor::hear(const char *data, size_t n) {
    if (task_ != nullptr) {
        xStreamBufferSend(commands_, data, n, 0);
    }
}

void IRAM_ATTR Sensor::on_data_ready(void *self) {
    Sensor &sensor = *static_cast<Sensor *>(self);
    BaseType_t woken = pdFALSE;
    sensor.rose_us_ = static_cast<uint64_t>(esp_timer_get_time());
    vTaskNotifyGiveFromISR(sensor.task_, &woken);
    if (woken) {
        portYIELD_FROM_ISR();
    }
}

/* The interrupt may write one half of it between the readings of both. */
uint64_t Sensor::rose_us() const {
    uint64_t rose_us = rose_us_;
    while (rose_us != rose_us_) {
        rose_us = rose_us_;
    }
    return rose_us;
}

/* Sleeps until a microsecond timer fires, whatever else wakes the task, then polls the clock for the last microseconds. */
void Sensor::wait(uint64_t t_us) {
    uint64_t now = Port::now_us(this);
    if (t_us > now + SHORT_US) {
        esp_timer_start_once(alarm_, t_us - now - WAKE_EARLY_US);
        while (now + WAKE_EARLY_US < t_us) {
            ulTaskNotifyTake(pdTRUE, pdMS_TO_TICKS((t_us - now) / 1000u) + LATE_TICKS);
            now = Port::now_us(this);
        }
        esp_timer_stop(alarm_);
    }
    while (Port::now_us(this) < t_us) {
    }
}

void Sensor::run(void *self) {
    Sensor &sensor = *static_cast<Sensor *>(self);
    if (sensor.pin_int1_ >= 0) {
        pinMode(sensor.pin_int1_, INPUT);
        attachInterruptArg(sensor.pin_int1_, on_data_ready, self, RISING);
    }
    esp_task_wdt_add(nullptr);
    gc_device_init(&sensor.device_, &sensor.config_);
    for (;;) {
        char data[64];
        size_t n;
        while ((n = xStreamBufferReceive(sensor.commands_, data, sizeof data, 0)) > 0) {
            gc_device_receive(&sensor.device_, data, n);
        }
        gc_device_step(&sensor.device_);
        esp_task_wdt_reset();
    }
}
