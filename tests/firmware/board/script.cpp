/* A board for the port, on this computer: its tasks, timers, buses, flash and serial port, in virtual time.
 *
 *     board FLASH SECONDS < SCRIPT         what the port writes goes to stdout, FLASH keeps what must survive power-off
 *
 * A line of the script is a time in seconds, in rising order, and
 *
 *     > TEXT                        a command, as typed
 *     chip I [NAME [ADDRESS]]       sensor I is there, an LSM6DSO if there is no name: 0, 1 at 0x6B, 0x6A of the first bus, 2, 3 of
 *                                   the second; parts of the other makers at 0x68, 0x69; or at the address, in hexadecimal digits
 *     world I T GX GY GZ AX AY AZ   what sensor I measures, raw counts at 250 dps and 2 g
 *     hold I                        sensor I stops in the middle of a byte and holds its bus's SDA low
 *     hang BUS                      the next transfer on the bus never ends, as by a fault of the driver
 *     low BUS, free BUS             the bus's SDA is tied low, as by a sensor without power; it no longer is
 *     pins SDA SCL                  the sensors of the first bus are wired to these pins
 *     network [NAME [PASSWORD]]     the wireless network that is there; none without a name
 *     reader I WORD [TEXT]          reader I comes by TCP, says TEXT and a newline, types TEXT without one, stalls (takes nothing any
 *                                   more), goes on, leaves
 *     ble WORD [TEXT]               a reader by Bluetooth comes [MTU], says TEXT, stalls (its link is congested), goes on, leaves
 *     listen on|off                 whether somebody reads the serial port, a native USB connector if nobody does
 *     reset N                       the reason of the board's last reset (esp_system.h), 1 if not told
 *     fail WHAT                     from now on the board has no: task (stack for a sensor's), flash (partition), wire (pins),
 *                                   nvs (free page in its flash)
 *
 * One task runs at a time, the one with the highest priority that can. Time passes while all of them wait, and in transfers,
 * flash writes and looks at the clock. */
#include "esp_system.h"
#include "simulated_board.h"

#include <cstdlib>
#include <deque>
#include <iostream>
#include <sstream>
#include <string>
#include <utility>

void setup();
void loop();

static std::deque<std::pair<uint64_t, std::string>> script;
static unsigned reset_reason = ESP_RST_POWERON;

esp_reset_reason_t esp_reset_reason() {
    return static_cast<esp_reset_reason_t>(reset_reason);
}

uint64_t next_line_us() {
    return script.empty() ? NEVER : script.front().first;
}

void obey_script() {
    while (next_line_us() <= now_us) {
        std::istringstream line(script.front().second);
        std::string word;
        unsigned i = 0;
        line >> word;
        if (word == ">") {
            std::string text;
            std::getline(line >> std::ws, text);
            type(text + '\n');
        } else if (word == "fail") {
            line >> word;
            fails.insert(word);
        } else if (word == "listen") {
            line >> word;
            listen(word == "on");
        } else if (word == "reset") {
            line >> reset_reason;
        } else if (word == "network") {
            set_network(line);
        } else if (word == "reader") {
            line >> i >> word;
            act_as_reader(i, word, line);
        } else if (word == "ble") {
            line >> word;
            act_by_bluetooth(word, line);
        } else if (word == "pins") {
            wire_to(line);
        } else if (line >> i && i < CHIPS) {
            if (word == "hang") {
                hang_bus(i);
            } else if (word == "low" || word == "free") {
                tie_low(i, word == "low");
            } else if (word == "chip") {
                word.clear();
                unsigned address = 0;
                line >> word >> std::hex >> address;
                power_on(i, word, address);
            } else if (word == "hold") {
                hold_bus(i);
            } else {
                set_world(i, line);
            }
        }
        script.pop_front();
    }
}

int main(int argc, char **argv) {
    if (argc != 3) {
        return 2;
    }
    end_us = static_cast<uint64_t>(1e6 * atof(argv[2]));
    double t_s;
    std::string text;
    while (std::cin >> t_s && std::getline(std::cin >> std::ws, text)) {
        script.emplace_back(static_cast<uint64_t>(1e6 * t_s), text);
    }
    read_flash(argv[1]);
    begin_first_task();
    obey_script();
    setup();
    for (;;) {
        loop();
    }
}
