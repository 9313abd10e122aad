/* A board for the port, on this computer: its tasks, timers, buses, flash and serial port, in virtual time.
 *
 *     board FLASH SECONDS < SCRIPT         what the port writes goes to stdout, FLASH keeps what must survive power-off
 *
 * A line of the script is a time in seconds, in rising order, and
 *
 *     > TEXT                        a command, as typed
 *     chip I                        sensor I is there: 0, 1 at 0x6B, 0x6A of the first bus, 2, 3 of the second
 *     world I T GX GY GZ AX AY AZ   what sensor I measures, raw counts at 250 dps and 2 g
 *     hold I                        sensor I stops in the middle of a byte and holds its bus's SDA low
 *     fail WHAT                     from now on the board has no: task (stack for a sensor's), flash (partition), wire (pins)
 *
 * One task runs at a time, the one with the highest priority that can. Time passes while all of them wait, and in transfers,
 * flash writes and looks at the clock. */
#include "Arduino.h"
#include "Preferences.h"
#include "Wire.h"
#include "esp_task_wdt.h"
#include "esp_timer.h"

extern "C" {
#include "emul_lsm6dso.h"
}

#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <fstream>
#include <functional>
#include <iostream>
#include <list>
#include <map>
#include <mutex>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#define I2C_BIT_US 2.5
#define SERIAL_BYTE_US (10e6 / 921600)
#define FLASH_WRITE_US 20000
#define NEVER UINT64_MAX
#define CHIPS 4
#define NOISE_COUNTS 5.0

void setup();
void loop();

/* ---- time and tasks ---- */

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

static uint64_t now_us, end_us, watchdog_us = NEVER;
static std::set<std::string> fails;
static std::mutex baton;
static std::list<task> tasks;
static std::list<esp_timer> timers;
static task *running;

static uint64_t next_edge_us();
static void look_at_pins();
static void obey_script();
static uint64_t next_line_us();

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
                printf("# watchdog\n");
                fflush(stdout);
                _Exit(1);
            }
            if ((t.deadline_us <= now_us || (t.ready && t.ready())) && (best == nullptr || t.priority > best->priority)) {
                best = &t;
            }
            wake_us = t.deadline_us < wake_us ? t.deadline_us : wake_us;
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
static void wait(std::function<bool()> ready, uint64_t deadline_us) {
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

static void pass(double us) {
    wait(nullptr, now_us + static_cast<uint64_t>(us + 0.5));
}

static uint64_t after(TickType_t ms) {
    return ms == portMAX_DELAY ? NEVER : now_us + 1000ull * ms;
}

extern "C" {
BaseType_t xTaskCreate(void (*code)(void *), const char *name, uint32_t, void *argument, UBaseType_t priority, TaskHandle_t *handle) {
    if (fails.count("task") > 0 && strcmp(name, "sensor") == 0) {
        return -1;
    }
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

esp_err_t esp_task_wdt_init(uint32_t timeout_s, bool) {
    watchdog_us = 1000000ull * timeout_s;
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

/* ---- what passes between tasks ---- */

struct semaphore {
    bool taken = false;
};

struct stream_buffer {
    size_t room;
    std::deque<char> bytes;
};

struct ring_buffer {
    size_t room;
    std::deque<std::string> items;
};

extern "C" {
SemaphoreHandle_t xSemaphoreCreateMutex() {
    return new semaphore;
}

BaseType_t xSemaphoreTake(SemaphoreHandle_t s, TickType_t ticks) {
    if (s->taken) {
        wait([s] { return !s->taken; }, after(ticks));
    }
    s->taken = true;
    return pdTRUE;
}

BaseType_t xSemaphoreGive(SemaphoreHandle_t s) {
    s->taken = false;
    return pdTRUE;
}

StreamBufferHandle_t xStreamBufferCreate(size_t bytes, size_t) {
    return new stream_buffer{bytes, {}};
}

size_t xStreamBufferSend(StreamBufferHandle_t b, const void *data, size_t n, TickType_t) {
    const char *from = static_cast<const char *>(data);
    const size_t fits = n < b->room - b->bytes.size() ? n : b->room - b->bytes.size();
    b->bytes.insert(b->bytes.end(), from, from + fits);
    return fits;
}

size_t xStreamBufferReceive(StreamBufferHandle_t b, void *data, size_t n, TickType_t) {
    const size_t got = n < b->bytes.size() ? n : b->bytes.size();
    std::copy(b->bytes.begin(), b->bytes.begin() + static_cast<long>(got), static_cast<char *>(data));
    b->bytes.erase(b->bytes.begin(), b->bytes.begin() + static_cast<long>(got));
    return got;
}

RingbufHandle_t xRingbufferCreate(size_t bytes, RingbufferType_t) {
    return new ring_buffer{bytes, {}};
}

size_t xRingbufferGetCurFreeSize(RingbufHandle_t r) {
    return r->room < 8 ? 0 : r->room - 8;
}

BaseType_t xRingbufferSend(RingbufHandle_t r, const void *item, size_t n, TickType_t) {
    const size_t takes = (n + 3) / 4 * 4 + 8; /* aligned, and a header */
    if (takes > r->room) {
        return pdFALSE;
    }
    r->room -= takes;
    r->items.emplace_back(static_cast<const char *>(item), n);
    return pdTRUE;
}

void *xRingbufferReceive(RingbufHandle_t r, size_t *n, TickType_t ticks) {
    wait([r] { return !r->items.empty(); }, after(ticks));
    if (r->items.empty()) {
        return nullptr;
    }
    *n = r->items.front().size();
    return &r->items.front()[0];
}

void vRingbufferReturnItem(RingbufHandle_t r, void *) {
    r->room += (r->items.front().size() + 3) / 4 * 4 + 8;
    r->items.pop_front();
}
}

/* ---- sensors, buses, pins ---- */

static emul_lsm6dso_t chip[CHIPS];
static bool present[CHIPS], holds[CHIPS];
static int16_t world[CHIPS][EMUL_WORDS];
static int clocks[2]; /* of a bus that nobody drives but the pins */
static struct {
    void (*handler)(void *);
    void *argument;
    bool high;
} int1;

static double gaussian() {
    static uint32_t lcg = 1;
    double sum = -6.0;
    for (int i = 0; i < 12; i++) {
        lcg = lcg * 1664525u + 1013904223u;
        sum += lcg / 4294967296.0;
    }
    return sum;
}

/* Every sample has a noise of its own. */
static void advance(int i, uint64_t t_us) {
    double before_us = -1.0;
    while (present[i] && chip[i].tick_us > before_us && chip[i].tick_us <= static_cast<double>(t_us)) {
        before_us = chip[i].tick_us;
        memcpy(chip[i].world, world[i], sizeof world[i]);
        for (int axis = 1; axis <= 3; axis++) {
            chip[i].world[axis] = static_cast<int16_t>(std::lround(world[i][axis] + NOISE_COUNTS * gaussian()));
        }
        emul_lsm6dso_advance(&chip[i], static_cast<uint64_t>(before_us) + 1u);
    }
}

static uint64_t next_edge_us() {
    return int1.handler != nullptr && chip[0].tick_us > 0.0 && chip[0].tick_us > static_cast<double>(now_us)
               ? static_cast<uint64_t>(chip[0].tick_us) + 1u
               : NEVER;
}

static void look_at_pins() {
    if (int1.handler == nullptr) {
        return;
    }
    advance(0, now_us);
    const bool high = emul_lsm6dso_int1(&chip[0]);
    const bool rose = high && !int1.high;
    int1.high = high;
    if (rose) {
        int1.handler(int1.argument);
    }
}

static int bus_of(const TwoWire *wire) {
    return wire == &Wire ? 0 : 1;
}

static int chip_at(const TwoWire *wire, uint8_t address) {
    const int i = 2 * bus_of(wire) + (address == 0x6B ? 0 : 1);
    const bool held = holds[2 * bus_of(wire)] || holds[2 * bus_of(wire) + 1];
    return (address == 0x6A || address == 0x6B) && present[i] && !held ? i : -1;
}

TwoWire Wire, Wire1;
static struct {
    uint8_t address;
    std::vector<uint8_t> sent;
    bool stop_due;
    std::deque<uint8_t> got;
} transfer[2];

bool TwoWire::begin(int, int, uint32_t frequency) {
    clocks[bus_of(this)] = 0;
    return frequency == 400000 && fails.count("wire") == 0;
}

bool TwoWire::end() {
    return true;
}

void TwoWire::setTimeOut(uint16_t) {
}

void TwoWire::beginTransmission(uint8_t address) {
    transfer[bus_of(this)].address = address;
    transfer[bus_of(this)].sent.clear();
}

size_t TwoWire::write(uint8_t data) {
    return write(&data, 1);
}

size_t TwoWire::write(const uint8_t *data, size_t n) {
    std::vector<uint8_t> &sent = transfer[bus_of(this)].sent;
    sent.insert(sent.end(), data, data + n);
    return n;
}

/* Without a stop it does no bus work: the reading that follows does. */
uint8_t TwoWire::endTransmission(bool stop) {
    auto &t = transfer[bus_of(this)];
    if (!stop) {
        return 0;
    }
    pass(I2C_BIT_US * (9.0 * static_cast<double>(t.sent.size() + 1u) + 2.0));
    const int i = chip_at(this, t.address);
    if (i < 0) {
        return 2;
    }
    advance(i, now_us);
    if (!t.sent.empty()) {
        emul_lsm6dso_write(&chip[i], now_us, t.sent[0], t.sent.data() + 1, t.sent.size() - 1);
    }
    return 0;
}

size_t TwoWire::requestFrom(uint8_t address, size_t n, bool) {
    auto &t = transfer[bus_of(this)];
    uint8_t data[128];
    t.got.clear();
    if (n > sizeof data) {
        return 0; /* as the real one's buffer */
    }
    pass(I2C_BIT_US * (9.0 * static_cast<double>(n + 3u) + 3.0));
    const int i = chip_at(this, address);
    if (i < 0) {
        return 0;
    }
    advance(i, now_us);
    const int got = emul_lsm6dso_read(&chip[i], now_us, t.sent[0], data, n);
    t.got.insert(t.got.end(), data, data + (got > 0 ? got : 0));
    return t.got.size();
}

int TwoWire::read() {
    std::deque<uint8_t> &got = transfer[bus_of(this)].got;
    const int byte = got.empty() ? -1 : got.front();
    if (!got.empty()) {
        got.pop_front();
    }
    return byte;
}

extern "C" {
void pinMode(uint8_t, uint8_t) {
}

/* Nine clocks, and a part that held the line has let go of it. */
void digitalWrite(uint8_t pin, uint8_t value) {
#if defined(GYROCAL_LED)
    if (pin == GYROCAL_LED) {
        printf("# light %.3f %d\n", 1e-6 * static_cast<double>(now_us), value);
    }
#endif
    if (pin == GYROCAL_SCL || pin == GYROCAL_SCL2) {
        const int bus = pin == GYROCAL_SCL ? 0 : 1;
        clocks[bus] += value == HIGH ? 1 : 0;
        if (clocks[bus] == 9) {
            holds[2 * bus] = holds[2 * bus + 1] = false;
        }
    }
}

int digitalRead(uint8_t) {
    advance(0, now_us);
    return emul_lsm6dso_int1(&chip[0]) ? HIGH : LOW;
}

void attachInterruptArg(uint8_t, void (*handler)(void *), void *argument, int) {
    int1.handler = handler;
    int1.argument = argument;
}

void neopixelWrite(uint8_t, uint8_t red, uint8_t green, uint8_t blue) {
    printf("# light %.3f %d %d %d\n", 1e-6 * static_cast<double>(now_us), red, green, blue);
}
}

/* ---- flash ---- */

static std::string flash_path;
static std::map<std::string, std::string> flash;
static std::map<const Preferences *, std::string> opened;

static void read_flash() {
    std::ifstream file(flash_path, std::ios::binary);
    std::string key;
    size_t n;
    while (file >> key >> n) {
        std::string value(n, '\0');
        file.get();
        file.read(&value[0], static_cast<std::streamsize>(n));
        flash[key] = value;
    }
}

bool Preferences::begin(const char *name, bool read_only, const char *partition) {
    const std::string path = std::string(partition) + "/" + name + "/";
    const auto first = flash.lower_bound(path);
    if (fails.count("flash") > 0 || (read_only && (first == flash.end() || first->first.compare(0, path.size(), path) != 0))) {
        return false;
    }
    opened[this] = path;
    return true;
}

void Preferences::end() {
    opened.erase(this);
}

bool Preferences::clear() {
    const std::string path = opened[this];
    for (auto kept = flash.lower_bound(path); kept != flash.end() && kept->first.compare(0, path.size(), path) == 0;) {
        kept = flash.erase(kept);
    }
    return true;
}

bool Preferences::isKey(const char *key) {
    return flash.count(opened[this] + key) > 0;
}

/* While flash is written nothing else runs. */
size_t Preferences::putBytes(const char *key, const void *value, size_t n) {
    if (opened.count(this) == 0) {
        return 0;
    }
    now_us += FLASH_WRITE_US;
    if (strlen(key) > 15) {
        return 0;
    }
    flash[opened[this] + key] = std::string(static_cast<const char *>(value), n);
    std::ofstream file(flash_path, std::ios::binary);
    for (const auto &kept : flash) {
        file << kept.first << ' ' << kept.second.size() << '\n' << kept.second;
    }
    return n;
}

size_t Preferences::getBytesLength(const char *key) {
    return flash[opened[this] + key].size();
}

size_t Preferences::getBytes(const char *key, void *buffer, size_t n) {
    const std::string &kept = flash[opened[this] + key];
    memcpy(buffer, kept.data(), kept.size() < n ? kept.size() : n);
    return kept.size();
}

/* ---- serial port ---- */

HardwareSerial Serial;
EspClass ESP;
static std::deque<char> typed;

/* The driver's buffer, which the wire empties. All of the port's functions share one lock, as Arduino's do. */
static semaphore serial_lock;
static bool serial_begun;
static size_t tx_room_bytes = 128;
static double tx_busy_until_us;

/* What was written comes out line by line: the light's own lines stand between them. */
static std::string unfinished;

static void show(const uint8_t *data, size_t n) {
    unfinished.append(reinterpret_cast<const char *>(data), n);
    const size_t whole = unfinished.rfind('\n') + 1;
    fwrite(unfinished.data(), 1, whole, stdout);
    unfinished.erase(0, whole);
}

static size_t tx_waiting() {
    const double us = tx_busy_until_us - static_cast<double>(now_us);
    return us > 0.0 ? static_cast<size_t>(us / SERIAL_BYTE_US) + 1u : 0u;
}

struct serial_guard {
    serial_guard() { xSemaphoreTake(&serial_lock, portMAX_DELAY); }
    ~serial_guard() { xSemaphoreGive(&serial_lock); }
};

void EspClass::restart() {
    printf("# restart\n");
    fflush(stdout);
    _Exit(0);
}

void HardwareSerial::begin(unsigned long baud) {
    serial_begun = true;
    if (baud != 921600) {
        _Exit(2);
    }
}

void HardwareSerial::flush() {
}

size_t HardwareSerial::setRxBufferSize(size_t n) {
    return n;
}

size_t HardwareSerial::setTxBufferSize(size_t n) {
    tx_room_bytes = serial_begun ? tx_room_bytes : n; /* afterwards it is refused */
    return n;
}

int HardwareSerial::available() {
    serial_guard guard;
    return static_cast<int>(typed.size());
}

int HardwareSerial::availableForWrite() {
    serial_guard guard;
    return static_cast<int>(tx_room_bytes - (tx_waiting() < tx_room_bytes ? tx_waiting() : tx_room_bytes));
}

/* What finds no room waits for the wire, the lock held. */
size_t HardwareSerial::write(const uint8_t *data, size_t n) {
    serial_guard guard;
    show(data, n);
    const double from_us = tx_busy_until_us > static_cast<double>(now_us) ? tx_busy_until_us : static_cast<double>(now_us);
    tx_busy_until_us = from_us + SERIAL_BYTE_US * static_cast<double>(n);
    if (tx_waiting() > tx_room_bytes) {
        pass(SERIAL_BYTE_US * static_cast<double>(tx_waiting() - tx_room_bytes));
    }
    return n;
}

size_t Stream::readBytes(char *buffer, size_t n) {
    serial_guard guard;
    size_t got = 0;
    for (; got < n && !typed.empty(); got++) {
        buffer[got] = typed.front();
        typed.pop_front();
    }
    return got;
}

/* ---- script ---- */

static std::deque<std::pair<uint64_t, std::string>> script;

static uint64_t next_line_us() {
    return script.empty() ? NEVER : script.front().first;
}

static void obey_script() {
    while (next_line_us() <= now_us) {
        std::istringstream line(script.front().second);
        std::string word;
        unsigned i = 0;
        line >> word;
        if (word == ">") {
            std::string text;
            std::getline(line >> std::ws, text);
            text += '\n';
            typed.insert(typed.end(), text.begin(), text.end());
        } else if (word == "fail") {
            line >> word;
            fails.insert(word);
        } else if (line >> i && i < CHIPS) {
            if (word == "chip") {
                present[i] = true;
                emul_lsm6dso_power_on(&chip[i], now_us, 250.0);
            } else if (word == "hold") {
                holds[i] = true;
            } else {
                for (int16_t &value : world[i]) {
                    line >> value;
                }
            }
        }
        script.pop_front();
    }
}

int main(int argc, char **argv) {
    if (argc != 3) {
        return 2;
    }
    flash_path = argv[1];
    end_us = static_cast<uint64_t>(1e6 * atof(argv[2]));
    double t_s;
    std::string text;
    while (std::cin >> t_s && std::getline(std::cin >> std::ws, text)) {
        script.emplace_back(static_cast<uint64_t>(1e6 * t_s), text);
    }
    read_flash();
    baton.lock();
    tasks.emplace_back();
    running = &tasks.back();
    obey_script();
    setup();
    for (;;) {
        loop();
    }
}
