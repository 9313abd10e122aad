/* The firmware's core as a Linux process: sentences on stdout, commands on stdin, the sensor an emulator fed with ROWS. */
#define _POSIX_C_SOURCE 200809L

#include "calibration.h"
#include "emul.h"
#include "gc_device.h"
#include "gc_error.h"
#include "gc_format.h"
#include "part.h"
#include "rows.h"
#include "weights.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define BUS_BIT_NS 2500u /* 400 kHz */
#define FAULT_FROM_US 1000000u /* after the first sample of the first run */
#define FASTEST_SINGLE_HZ 833.0f
#define USAGE "usage: gyrocal-sim ROWS [--speed X|max] [--imu N] [--stream raw|off] [--fifo N] [--fault NAME|list] [--hold]"

static const struct {
    const char *name;
    const char *means;
    uint64_t lasts_us; /* 0: from power-on, for good */
} faults[] = {
    {"nack", "the sensor does not answer for 0.2 s", 200000},
    {"wrong_id", "another part answers", 0},
    {"stale", "no new samples for 0.3 s", 300000},
    {"brownout", "the registers fall back to their defaults", 1},
    {"stuck_bit", "bit 2 of the rates is always 1", 0},
    {"reset_timeout", "the part does not come out of reset", 0},
    {"bad_tags", "the FIFO's words come damaged for 0.3 s", 300000},
    {"busy", "the board does something else for 3 s", 3000000},
};
#define FAULTS (sizeof faults / sizeof faults[0])

typedef struct {
    /* options */
    double speed; /* virtual seconds a second; 0 = as fast as the reader takes it */
    int fault;    /* -1 none */
    unsigned fifo;
    bool hold;

    rows_t rows;
    uint64_t now_us; /* since power-on: moves only through waits and the bus */
    emul_t chip;
    gc_device_t device;

    /* The run being replayed: row k stands at base_us + t_us. */
    const rows_row_t *row, *rows_end;
    uint64_t base_us;
    unsigned long missed; /* rows that nobody read, the sensor being set up */
    uint64_t fault_us;    /* when it begins; 0 = not yet known */
    bool fault_over;

    uint64_t paced_us; /* virtual time and */
    double wall_s;     /* real time that belong together */

    char rest[GC_WIRE_MAX]; /* of a sentence that was taken in part */
    size_t rest_n;
    bool stdin_open;
} sim_t;

static double wall_s(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* ---- virtual time ---- */

static void pace(sim_t *sim, double speed) {
    if (speed > 0.0) {
        const double due_s = sim->wall_s + 1e-6 * (double)(sim->now_us - sim->paced_us) / speed - wall_s();
        if (due_s > 0.0) {
            const struct timespec t = {(time_t)due_s, (long)(1e9 * (due_s - floor(due_s)))};
            nanosleep(&t, NULL);
        }
    }
}

static void pace_from_here(sim_t *sim) {
    sim->paced_us = sim->now_us;
    sim->wall_s = wall_s();
}

static void move_to(sim_t *sim, uint64_t t_us);

static void misbehave(sim_t *sim) {
    if (sim->fault < 0 || faults[sim->fault].lasts_us == 0 || sim->fault_us == 0 || sim->now_us < sim->fault_us) {
        return;
    }
    const char *name = faults[sim->fault].name;
    const bool on = sim->now_us < sim->fault_us + faults[sim->fault].lasts_us;
    sim->chip.nack = on && strcmp(name, "nack") == 0;
    sim->chip.stale = on && strcmp(name, "stale") == 0;
    sim->chip.bad_tags = on && strcmp(name, "bad_tags") == 0;
    if (!sim->fault_over && strcmp(name, "brownout") == 0) {
        emul_brown_out(&sim->chip);
    }
    if (!sim->fault_over && strcmp(name, "busy") == 0) {
        sim->fault_over = true;
        move_to(sim, sim->fault_us + faults[sim->fault].lasts_us);
    }
    sim->fault_over = true;
}

static bool in_run(const sim_t *sim) {
    return sim->row < sim->rows_end;
}

static uint64_t next_row_us(const sim_t *sim) {
    return sim->base_us + sim->row->t_us;
}

static void feed_row(sim_t *sim) {
    emul_feed(&sim->chip, next_row_us(sim), sim->row->world);
    sim->row++;
}

/* The FIFO takes each row at its time, whatever the device does meanwhile. */
static void feed_fifo(sim_t *sim) {
    while (emul_batches(&sim->chip) && in_run(sim) && next_row_us(sim) <= sim->now_us) {
        feed_row(sim);
    }
}

static void move_to(sim_t *sim, uint64_t t_us) {
    if (t_us > sim->now_us) {
        sim->now_us = t_us;
        pace(sim, sim->speed);
    }
    misbehave(sim);
    feed_fifo(sim);
    emul_advance(&sim->chip, sim->now_us);
}

static void wait_until_us(void *context, uint64_t t_us) {
    move_to(context, t_us);
}

static void skip_missed_rows(sim_t *sim) {
    while (in_run(sim) && next_row_us(sim) < sim->now_us) {
        sim->row++;
        sim->missed++;
    }
}

/* During a run a sample is due when its row is, whatever the device's timer says: each row is read once, at its time. Of
   the FIFO a batch is due when the device says so, but not after the last row. */
static void wait_sample_us(void *context, uint64_t due_us) {
    sim_t *sim = context;
    if (emul_batches(&sim->chip)) {
        const uint64_t last_us = in_run(sim) ? sim->base_us + sim->rows_end[-1].t_us : due_us;
        move_to(sim, due_us < last_us ? due_us : last_us);
        return;
    }
    do {
        skip_missed_rows(sim);
        if (!in_run(sim)) {
            move_to(sim, due_us);
            return;
        }
        move_to(sim, next_row_us(sim));
    } while (sim->now_us > next_row_us(sim));
    feed_row(sim);
}

static uint64_t now_us(void *context) {
    return ((sim_t *)context)->now_us;
}

/* A transfer takes its time on the bus, but never the time of the next row. */
static void spend_bus_time(sim_t *sim, size_t bytes) {
    uint64_t t_us = sim->now_us + (BUS_BIT_NS * (9u * bytes + 3u) + 999u) / 1000u;
    if (in_run(sim) && next_row_us(sim) < t_us && next_row_us(sim) >= sim->now_us) {
        t_us = next_row_us(sim);
    }
    sim->now_us = t_us;
}

static int bus_write(void *context, uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
    sim_t *sim = context;
    const int taken = address == PART_ADDRESS ? emul_write(&sim->chip, sim->now_us, reg, data, n) : -1;
    spend_bus_time(sim, n + 2u);
    return taken;
}

static int bus_read(void *context, uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
    sim_t *sim = context;
    const int given = address == PART_ADDRESS ? emul_read(&sim->chip, sim->now_us, reg, data, n) : -1;
    spend_bus_time(sim, n + 3u);
    return given;
}

/* ---- stdin and stdout ---- */

static size_t write_some(const char *data, size_t n) {
    size_t done = 0;
    while (done < n) {
        const ssize_t k = write(STDOUT_FILENO, data + done, n - done);
        if (k > 0) {
            done += (size_t)k;
        } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
            break;
        } else if (errno != EINTR) {
            exit(0); /* the reader is gone */
        }
    }
    return done;
}

/* In real time stdout does not block: a sentence that finds no room at all is dropped whole, by the device's count. */
static int send(void *context, const char *data, size_t n) {
    sim_t *sim = context;
    if (sim->rest_n > 0) {
        const size_t done = write_some(sim->rest, sim->rest_n);
        sim->rest_n -= done;
        memmove(sim->rest, sim->rest + done, sim->rest_n);
        if (sim->rest_n > 0) {
            return 0;
        }
    }
    const size_t done = write_some(data, n);
    if (done == 0) {
        return 0;
    }
    sim->rest_n = n - done;
    memcpy(sim->rest, data + done, sim->rest_n);
    return (int)n;
}

static void hear(sim_t *sim) {
    char data[256];
    struct pollfd in = {STDIN_FILENO, POLLIN, 0};
    while (sim->stdin_open && poll(&in, 1, 0) > 0) {
        const ssize_t n = read(STDIN_FILENO, data, sizeof data);
        if (n > 0) {
            gc_device_receive(&sim->device, data, (size_t)n);
        } else if (n == 0 || (errno != EINTR && errno != EAGAIN)) {
            sim->stdin_open = false;
        }
    }
}

static void command(sim_t *sim, const char *text) {
    gc_device_receive(&sim->device, text, strlen(text));
    gc_device_receive(&sim->device, "\n", 1);
}

/* The shortest decimal that is this float32: 77.3, as a person set it, not 77.3000031. */
static void command_set(sim_t *sim, const char *name, float value, const char *if_nan) {
    char number[32];
    char text[GC_COMMAND_MAX];
    for (int digits = 6; digits <= 9; digits++) {
        snprintf(number, sizeof number, "%.*g", digits, (double)value);
        if (strtof(number, NULL) == value) {
            break;
        }
    }
    snprintf(text, sizeof text, "set %s %s", name, isnan(value) ? if_nan : number);
    command(sim, text);
}

/* ---- replay ---- */

/* Between runs the table stands still in the pose of the run to come. */
static void stand_still(sim_t *sim, const rows_run_t *run) {
    rows_row_t row = sim->rows.rows[run->first_row];
    row.world[1] = row.world[2] = row.world[3] = 0;
    emul_feed(&sim->chip, sim->now_us, row.world);
}

/* A part whose own clock makes its nominal output data rate the rows' true one. */
static double clock_of(double rate_hz) {
    return gc_part_odr_for(&PART, rate_hz) == rate_hz ? emul_clock_for(rate_hz) : 1.0;
}

static void power_on(sim_t *sim, const gc_device_config_t *config, const rows_run_t *run, bool stream) {
    sim->now_us = 0;
    sim->fault_us = sim->fault_us == 0 ? 0 : UINT64_MAX; /* a passing fault passes once */
    pace_from_here(sim);
    sim->chip.clock = clock_of((double)sim->rows.sample_rate_hz);
    emul_power_on(&sim->chip, 0, (double)sim->rows.full_scale_dps);
    if (sim->fault >= 0 && faults[sim->fault].lasts_us == 0) {
        const char *name = faults[sim->fault].name;
        sim->chip.wrong_id = strcmp(name, "wrong_id") == 0;
        sim->chip.stuck_bit = strcmp(name, "stuck_bit") == 0;
        sim->chip.stuck_reset = strcmp(name, "reset_timeout") == 0;
    }
    stand_still(sim, run);
    gc_device_init(&sim->device, config);
    command_set(sim, "full_scale_dps", sim->rows.full_scale_dps, "");
    const bool fast = sim->fifo > 0u && sim->rows.sample_rate_hz > FASTEST_SINGLE_HZ; /* refused before the FIFO is in use */
    command_set(sim, "rate_hz", fast ? FASTEST_SINGLE_HZ : sim->rows.sample_rate_hz, "");
    command_set(sim, "fifo", (float)sim->fifo, "");
    if (fast) {
        command_set(sim, "rate_hz", sim->rows.sample_rate_hz, "");
    }
    command(sim, "hello"); /* the one at boot came before these */
    if (stream) {
        command(sim, "stream raw");
    }
}

static void replay(sim_t *sim, const rows_run_t *run) {
    const rows_row_t *first = &sim->rows.rows[run->first_row];
    uint64_t start_us = sim->now_us;
    if (run->power_on_s * 1e6f > (float)start_us) {
        start_us = (uint64_t)llrint((double)run->power_on_s * 1e6);
    }
    stand_still(sim, run);
    if (sim->speed > 0.0 || sim->fifo > 0u) { /* someone may be watching, the FIFO fills: the device goes on, idle */
        while (sim->now_us + (uint64_t)((2.0 + sim->fifo) * 1e6 / (double)sim->rows.sample_rate_hz) < start_us) {
            hear(sim);
            gc_device_step(&sim->device);
        }
    }
    move_to(sim, start_us);
    static const char *const set_axis[] = {"set axis x", "set axis y", "set axis z"};
    command(sim, set_axis[run->axis]);
    command_set(sim, "table_dps", run->table_dps, "none");
    command_set(sim, "turn_deg", run->turn_deg, "0");
    sim->chip.fed_only = emul_batches(&sim->chip);
    command(sim, run->face > 0 ? "start up" : "start down");

    /* Only differences of t_us count; the first row may stand anywhere. */
    start_us = sim->now_us;
    sim->base_us = start_us - first->t_us;
    sim->row = first;
    sim->rows_end = first + run->n_rows;
    if (sim->fault_us == 0) {
        sim->fault_us = start_us + FAULT_FROM_US;
    }
    while (in_run(sim)) {
        hear(sim);
        gc_device_step(&sim->device);
        skip_missed_rows(sim);
    }
    command(sim, "stop");
    sim->chip.fed_only = false;
}

static void replay_all(sim_t *sim, const gc_device_config_t *config, bool stream) {
    for (uint32_t i = 0; i < sim->rows.n_runs; i++) {
        const rows_run_t *run = &sim->rows.runs[i];
        if (i == 0 || run->power_cycle != run[-1].power_cycle) {
            power_on(sim, config, run, stream);
        }
        replay(sim, run);
    }
    if (sim->hold) {
        sim->speed = sim->speed > 0.0 ? sim->speed : 1.0;
        pace_from_here(sim);
        while (sim->stdin_open) {
            hear(sim);
            gc_device_step(&sim->device);
        }
    }
}

static int usage(const char *wrong) {
    fprintf(stderr, "gyrocal-sim: %s; %s\n", wrong, USAGE);
    return 2;
}

static int stdout_flags;

static void restore_stdout(void) {
    fcntl(STDOUT_FILENO, F_SETFL, stdout_flags);
}

int main(int argc, char **argv) {
    static sim_t sim;
    const char *path = NULL;
    bool stream = false;
    unsigned imu = 0;
    sim.speed = 1.0;
    sim.fault = -1;
    sim.stdin_open = true;
    for (int i = 1; i < argc; i++) {
        const char *option = argv[i];
        if (strcmp(option, "--hold") == 0) {
            sim.hold = true;
            continue;
        }
        if (option[0] != '-') {
            if (path != NULL) {
                return usage("more than one ROWS file");
            }
            path = option;
            continue;
        }
        const char *value = ++i < argc ? argv[i] : "";
        uint64_t number;
        if (strcmp(option, "--speed") == 0) {
            sim.speed = 0.0;
            if (strcmp(value, "max") != 0 &&
                (gc_parse_real(value, strlen(value), &sim.speed) != GC_OK || !(sim.speed > 0.0))) {
                return usage("--speed takes a positive number or max");
            }
        } else if (strcmp(option, "--imu") == 0) {
            if (gc_parse_uint(value, strlen(value), &number) != GC_OK || number > 255) {
                return usage("--imu takes a number within 0 and 255");
            }
            imu = (unsigned)number;
        } else if (strcmp(option, "--stream") == 0) {
            stream = strcmp(value, "raw") == 0;
            if (!stream && strcmp(value, "off") != 0) {
                return usage("--stream takes raw or off");
            }
        } else if (strcmp(option, "--fifo") == 0) {
            if (gc_parse_uint(value, strlen(value), &number) != GC_OK || number > GC_BATCH_MAX) {
                return usage("--fifo takes a number of samples, 128 at most");
            }
            sim.fifo = (unsigned)number;
        } else if (strcmp(option, "--fault") == 0) {
            for (size_t k = 0; k < FAULTS; k++) {
                if (strcmp(value, "list") == 0) {
                    printf("%s\t%s\n", faults[k].name, faults[k].means);
                } else if (strcmp(value, faults[k].name) == 0) {
                    sim.fault = (int)k;
                }
            }
            if (strcmp(value, "list") == 0) {
                return 0;
            }
            if (sim.fault < 0) {
                return usage("no such fault, see --fault list");
            }
        } else {
            return usage("no such option");
        }
    }
    if (path == NULL) {
        return usage("no ROWS file");
    }
    const char *wrong = rows_load(&sim.rows, path);
    if (wrong != NULL) {
        fprintf(stderr, "gyrocal-sim: %s: %s\n", path, wrong);
        return 2;
    }
    stdout_flags = fcntl(STDOUT_FILENO, F_GETFL);
    if (sim.speed > 0.0 && sim.speed <= 1.0 && stdout_flags >= 0) { /* faster than real time waits for its reader */
        fcntl(STDOUT_FILENO, F_SETFL, stdout_flags | O_NONBLOCK);
        atexit(restore_stdout);
    }

    const gc_port_t port = {
        .context = &sim,
        .bus_write = bus_write,
        .bus_read = bus_read,
        .now_us = now_us,
        .wait_until_us = wait_until_us,
        .wait_sample_us = wait_sample_us,
        .send = send,
    };
    const gc_device_config_t config = {
        .port = &port,
        .part = &PART,
        .address = PART_ADDRESS,
        .imu = imu,
        .calibration = &gc_calibration,
        .net = &gc_net,
    };
    replay_all(&sim, &config, stream);
    if (sim.missed > 0) {
        fprintf(stderr, "gyrocal-sim: %lu rows were not read: the sensor was being set up or the board was busy\n", sim.missed);
    }
    rows_free(&sim.rows);
    return 0;
}
