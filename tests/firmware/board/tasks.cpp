/* Tasks, timers and the watchdog in virtual time. One task runs at a time, the one with the highest priority that can. */
#include "simulated_board.h"
#include "esp_system.h"
#include "esp_task_wdt.h"
#include "esp_timer.h"

#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <list>
#include <mutex>
#include <thread>

struct task {
    unsigned priority = 1;
    uint32_t notes = 0;
    uint64_t watched_us = NEVER; /* when the watchdog was last fed */
    std::function<bool()> ready;
    uint64_t deadline_us = 0;
    std::condition_variable turn;
};

struct esp_timer {
    esp_timer_create_args_t arguments;
    uint64_t due_us = NEVER;
};

uint64_t now_us, end_us;
bool hangs;
std::set<std::string> fails;
static uint64_t watchdog_us = NEVER;
static std::mutex baton;
static std::list<task> tasks;
static std::list<esp_timer> timers;
static task *running;

static void fire_what_is_due() {
    obey_script();
    look_at_pins();
    for (esp_timer &timer : timers) {
        if (timer.due_us <= now_us) {
            timer.due_us = NEVER;
            timer.arguments.callback(timer.arguments.arg);
        }
    }
}

static task *next_task() {
    for (;;) {
        fire_what_is_due();
        if (now_us >= end_us) {
            fflush(stdout);
            _Exit(0);
        }
        task *best = nullptr;
        uint64_t wake_us = next_edge_us() < next_line_us() ? next_edge_us() : next_line_us();
        for (task &t : tasks) {
            if (t.watched_us != NEVER && now_us - t.watched_us > watchdog_us) {
                printf("# watchdog %.3f\n", 1e-6 * static_cast<double>(now_us));
                fflush(stdout);
                _Exit(hangs ? 0 : 1);
            }
            if ((t.deadline_us <= now_us || (t.ready && t.ready())) && (best == nullptr || t.priority > best->priority)) {
                best = &t;
            }
            wake_us = t.deadline_us < wake_us ? t.deadline_us : wake_us;
            if (t.watched_us != NEVER && watchdog_us != NEVER && t.watched_us + watchdog_us + 1u < wake_us) {
                wake_us = t.watched_us + watchdog_us + 1u;
            }
        }
        if (best != nullptr) {
            return best;
        }
        for (esp_timer &timer : timers) {
            wake_us = timer.due_us < wake_us ? timer.due_us : wake_us;
        }
        now_us = wake_us < end_us ? wake_us : end_us;
    }
}

/* The running task waits, others run. */
void wait(std::function<bool()> ready, uint64_t deadline_us) {
    task *self = running;
    self->ready = ready;
    self->deadline_us = deadline_us;
    running = next_task();
    if (running != self) {
        std::unique_lock<std::mutex> lock(baton, std::adopt_lock);
        running->turn.notify_one();
        self->turn.wait(lock, [self] { return running == self; });
        lock.release();
    }
    self->ready = nullptr;
}

void pass(double us) {
    wait(nullptr, now_us + static_cast<uint64_t>(us + 0.5));
}

uint64_t after(TickType_t ms) {
    return ms == portMAX_DELAY ? NEVER : now_us + 1000ull * ms;
}

extern "C" {
static BaseType_t create(void (*code)(void *), void *argument, UBaseType_t priority, TaskHandle_t *handle) {
    tasks.emplace_back();
    task *t = &tasks.back();
    t->priority = priority;
    if (handle != nullptr) {
        *handle = t;
    }
    std::thread([t, code, argument] {
        std::unique_lock<std::mutex> lock(baton);
        t->turn.wait(lock, [t] { return running == t; });
        lock.release();
        code(argument);
    }).detach();
    return pdTRUE;
}

/* A sensor's task computes with the FPU, and would stay on the core that happens to be free first. */
BaseType_t xTaskCreate(void (*code)(void *), const char *name, uint32_t, void *argument, UBaseType_t priority, TaskHandle_t *handle) {
    if (strcmp(name, "sensor") == 0) {
        _Exit(2);
    }
    return create(code, argument, priority, handle);
}

BaseType_t xTaskCreatePinnedToCore(void (*code)(void *), const char *name, uint32_t, void *argument, UBaseType_t priority,
                                   TaskHandle_t *handle, BaseType_t core) {
    if (fails.count("task") > 0 && strcmp(name, "sensor") == 0) {
        return -1;
    }
    if (core < 0 || core >= portNUM_PROCESSORS) {
        _Exit(2);
    }
    return create(code, argument, priority, handle);
}

UBaseType_t uxTaskGetStackHighWaterMark(TaskHandle_t) {
    return 8192;
}

uint32_t esp_get_minimum_free_heap_size() {
    return 150000;
}

BaseType_t xTaskNotifyGive(TaskHandle_t t) {
    t->notes++;
    return pdTRUE;
}

void vTaskNotifyGiveFromISR(TaskHandle_t t, BaseType_t *woken) {
    t->notes++;
    *woken = pdTRUE;
}

uint32_t ulTaskNotifyTake(BaseType_t, TickType_t ticks) {
    task *self = running;
    wait([self] { return self->notes > 0; }, after(ticks));
    const uint32_t notes = self->notes;
    self->notes = 0;
    return notes;
}

esp_err_t esp_timer_create(const esp_timer_create_args_t *arguments, esp_timer_handle_t *timer) {
    timers.emplace_back();
    timers.back().arguments = *arguments;
    *timer = &timers.back();
    return 0;
}

esp_err_t esp_timer_start_once(esp_timer_handle_t timer, uint64_t timeout_us) {
    if (timer->due_us != NEVER) {
        return 0x103; /* ESP_ERR_INVALID_STATE: it runs */
    }
    timer->due_us = now_us + timeout_us;
    return 0;
}

esp_err_t esp_timer_stop(esp_timer_handle_t timer) {
    timer->due_us = NEVER;
    return 0;
}

int64_t esp_timer_get_time() {
    return static_cast<int64_t>(++now_us);
}

/* Without a panic the board would go on. */
esp_err_t esp_task_wdt_init(uint32_t timeout_s, bool panic) {
    watchdog_us = panic ? 1000000ull * timeout_s : NEVER;
    return 0;
}

esp_err_t esp_task_wdt_add(TaskHandle_t t) {
    (t == nullptr ? running : t)->watched_us = now_us;
    return 0;
}

esp_err_t esp_task_wdt_reset() {
    running->watched_us = now_us;
    return 0;
}

unsigned long micros() {
    return static_cast<unsigned long>(++now_us);
}

unsigned long millis() {
    return static_cast<unsigned long>(now_us / 1000);
}

void delay(uint32_t ms) {
    pass(1000.0 * ms);
}

void delayMicroseconds(uint32_t us) {
    now_us += us;
}
}

void begin_first_task() {
    baton.lock();
    tasks.emplace_back();
    running = &tasks.back();
}
