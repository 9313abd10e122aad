/* What the parts of the board share: virtual time, what the script makes fail, and what the script sets. */
#ifndef SIMULATED_BOARD_H
#define SIMULATED_BOARD_H

#include "Arduino.h"

#include <cstdint>
#include <functional>
#include <iosfwd>
#include <set>
#include <string>

#define NEVER UINT64_MAX
#define CHIPS 4

extern uint64_t now_us, end_us;
extern bool hangs; /* the script has made a task hang */
extern std::set<std::string> fails;

struct semaphore {
    bool taken = false;
};

/* tasks.cpp: the running task waits until `ready` or the deadline, or lets `us` microseconds pass; others run. */
void wait(std::function<bool()> ready, uint64_t deadline_us);
void pass(double us);
uint64_t after(TickType_t ms);
void begin_first_task();

/* buses.cpp: the time of the next edge on the interrupt pin, and what the script does to sensor i. */
uint64_t next_edge_us();
void look_at_pins();
void power_on(unsigned i, const std::string &name, unsigned address);
void hold_bus(unsigned i);
void hang_bus(unsigned bus);
void tie_low(unsigned bus, bool low);
void wire_to(std::istream &pins);
void set_world(unsigned i, std::istream &counts);

/* What sensor 0 hears and says by SPI. A transfer that its maker does not allow ends the board (emul_spi.h). */
void pass_by_spi(unsigned die, unsigned mode, uint32_t hz, const uint8_t *out, size_t n_out, uint8_t *in, size_t n_in);

/* spi.cpp: a pin that may be a chip select. */
void turn_select(int pin, bool high);

/* network.cpp: the network that is there, none if it has no name, and what the script makes a reader do. */
void set_network(std::istream &words);
void act_as_reader(unsigned i, const std::string &word, std::istream &words);

/* bluetooth.cpp: the same by Bluetooth. */
void act_by_bluetooth(const std::string &word, std::istream &words);

/* flash.cpp, serial.cpp: the file that keeps the flash; whether the port is read, and text typed by the person there. */
void read_flash(const char *path);
void listen(bool on);
void type(const std::string &text);

/* script.cpp */
uint64_t next_line_us();
void obey_script();

#endif
