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
#include "simulated_board.h"

#include <cstdlib>
#include <deque>
#include <iostream>
#include <sstream>
#include <utility>

void setup();
void loop();

static std::deque<std::pair<uint64_t, std::string>> script;

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
        } else if (line >> i && i < CHIPS) {
            if (word == "chip") {
                power_on(i);
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
