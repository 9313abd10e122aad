/* The firmware's core as a Linux process. It writes sentences to stdout and reads commands from stdin. An emulator that
   replays a ROWS file replaces the sensor. */
#define _POSIX_C_SOURCE 200809L

#include "calibration.h"
#include "emul_spi.h"
#include "flash.h"
#include "gc_device.h"
#include "gc_error.h"
#include "gc_format.h"
#include "options.h"
#include "part.h"
#include "rows.h"
#include "weights.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define BUS_BIT_NS 2500u /* I2C at 400 kHz */
#define SPI_SELECT_NS 2000u
#define FLASH_US 5000u   /* duration of a write */
#define WATCHDOG_US 10000000u
#define USB_BYTES 4096u  /* that a port holds for a reader who does not come */
#define FASTEST_SINGLE_HZ 833.0f
#define BENCH_NOISE_DPS 0.045
#define BENCH_NOISE_ACC 20.0 /* counts */

typedef struct {
    options_t options;
    rows_t rows;
    uint64_t now_us; /* since power-on; only waits and bus transfers advance it */
    uint64_t awake_us; /* the end of the last wait for a sample */
    emul_t part;
    gc_device_t device;

    /* The run that is replayed. Row k has the time base_us + t_us. */
    const rows_row_t *row, *rows_end;
    uint64_t base_us;
    unsigned long missed; /* rows that were not read because the sensor was being set up */

    uint64_t past_us;      /* in power cycles before this one */
    bool begun;            /* the first run has: */
    uint64_t begun_us;     /* in all, from the first power-on */
    uint64_t jumped_us;    /* by which the board's clock is ahead of now_us */
    flash_t flash;
    jmp_buf power_lost;
    uint32_t run;          /* the one that is replayed */
    bool replaying, is_off;
    uint32_t dice; /* for the noise on a bench */

    uint64_t paced_us; /* virtual time and */
    double wall_s;     /* real time that belong together */

    char rest[USB_BYTES + GC_WIRE_MAX]; /* what was taken and is not written: of a sentence, and while nobody reads */
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

/* Time since the first sample of the first run, s. */
static double fault_s(const sim_t *sim) {
    return sim->begun ? 1e-6 * ((double)(sim->past_us + sim->now_us) - (double)sim->begun_us) : -INFINITY;
}

static bool is_on(const sim_t *sim, fault_kind_t kind) {
    return faults_on(&sim->options.faults, kind, fault_s(sim));
}

static bool begins(sim_t *sim, fault_kind_t kind, double *length_s) {
    return faults_begins(&sim->options.faults, kind, fault_s(sim), length_s);
}

static void misbehave(sim_t *sim) {
    double length_s = 0.0;
    const emul_faults_t faults = {.nack = is_on(sim, FAULT_NACK), .wrong_id = is_on(sim, FAULT_WRONG_ID),
                                  .stale = is_on(sim, FAULT_STALE), .stuck_bit = is_on(sim, FAULT_STUCK_BIT),
                                  .stuck_reset = is_on(sim, FAULT_RESET_TIMEOUT), .bad_tags = is_on(sim, FAULT_BAD_TAGS),
                                  .stuck_axes = is_on(sim, FAULT_STUCK_MASS) ? EMUL_ALL_AXES : 0u};
    emul_set_faults(&sim->part, &faults);
    if (begins(sim, FAULT_BROWNOUT, &length_s)) {
        emul_brown_out(&sim->part);
    }
    sim->options.faults.turned_over = begins(sim, FAULT_EARLY_FLIP, &length_s) || sim->options.faults.turned_over;
    if (begins(sim, FAULT_CLOCK_JUMP, &length_s)) {
        sim->jumped_us += (uint64_t)(1e6 * length_s);
    }
    if (begins(sim, FAULT_BUSY, &length_s)) {
        move_to(sim, sim->now_us + (uint64_t)(1e6 * length_s));
    }
    if (begins(sim, FAULT_HANG, &length_s)) {
        move_to(sim, sim->now_us + WATCHDOG_US);
        longjmp(sim->power_lost, 1);
    }
    if (begins(sim, FAULT_SUPPLY, &length_s)) {
        longjmp(sim->power_lost, 1);
    }
}

/* The readings of the sensor at a row, including its faults. */
static void feed(sim_t *sim, uint64_t t_us, const int16_t row[EMUL_WORDS]) {
    int16_t world[EMUL_WORDS];
    memcpy(world, row, sizeof world);
    faults_change_reading(&sim->options.faults, fault_s(sim), sim->rows.runs[sim->run].axis, world);
    emul_feed(&sim->part, t_us, world);
}

/* About a standard normal deviate. */
static double noise(sim_t *sim) {
    double sum = -6.0;
    for (int i = 0; i < 12; i++) {
        sim->dice = sim->dice * 1664525u + 1013904223u;
        sum += (double)sim->dice / 4294967296.0;
    }
    return sum;
}

/* On a bench, at rest with the axis z up. */
static void lie_still(sim_t *sim) {
    const double counts = BENCH_NOISE_DPS / ((double)sim->rows.full_scale_dps * EMUL_WORLD_DPS_OF_SCALE);
    int16_t world[EMUL_WORDS] = {0, 0, 0, 0, 0, 0, 0};
    for (int i = 1; i < EMUL_WORDS; i++) {
        world[i] = emul_counts((i == 6 ? 1.0 / EMUL_WORLD_G : 0.0) + (i < 4 ? counts : BENCH_NOISE_ACC) * noise(sim));
    }
    faults_change_reading(&sim->options.faults, fault_s(sim), 2, world);
    emul_set_world(&sim->part, world);
}

static bool in_run(const sim_t *sim) {
    return sim->row < sim->rows_end;
}

static uint64_t next_row_us(const sim_t *sim) {
    return sim->base_us + sim->row->t_us;
}

static void feed_row(sim_t *sim) {
    feed(sim, next_row_us(sim), sim->row->world);
    sim->row++;
}

/* The FIFO stores each row at its time, whatever the device does meanwhile. */
static void feed_fifo(sim_t *sim) {
    while (emul_batches(&sim->part) && in_run(sim) && next_row_us(sim) <= sim->now_us) {
        feed_row(sim);
    }
}

static void move_to(sim_t *sim, uint64_t t_us) {
    if (t_us > sim->now_us) {
        sim->now_us = t_us;
        pace(sim, sim->options.speed);
    }
    misbehave(sim);
    if (sim->options.bench) {
        lie_still(sim);
    }
    feed_fifo(sim);
    emul_advance(&sim->part, sim->now_us);
}

/* The time of the board's clock, which may be ahead. */
static uint64_t of_board(const sim_t *sim, uint64_t t_us) {
    return t_us > sim->jumped_us ? t_us - sim->jumped_us : 0u;
}

static void wait_until_us(void *context, uint64_t t_us) {
    move_to(context, of_board(context, t_us));
}

static void skip_missed_rows(sim_t *sim) {
    while (in_run(sim) && next_row_us(sim) < sim->now_us) {
        sim->row++;
        sim->missed++;
    }
}

/* During a run a sample is due when its row is, whatever the device's timer says: each row is read once, at its time. Of
   the FIFO a batch is due when the device says so, but not after the last row. */
static void wait_for_row(sim_t *sim, uint64_t due_us) {
    due_us = of_board(sim, due_us);
    const uint64_t wakes_us = sim->options.sleep_us > 0u ? sim->awake_us + sim->options.sleep_us : 0u;
    due_us = due_us > wakes_us ? due_us : wakes_us;
    if (emul_batches(&sim->part)) {
        const uint64_t last_us = in_run(sim) ? sim->base_us + sim->rows_end[-1].t_us : due_us;
        move_to(sim, due_us < last_us ? due_us : last_us);
        return;
    }
    if (wakes_us > 0u) {
        move_to(sim, wakes_us);
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

static void wait_sample_us(void *context, uint64_t due_us) {
    sim_t *sim = context;
    wait_for_row(sim, due_us);
    sim->awake_us = sim->now_us;
}

static uint64_t now_us(void *context) {
    const sim_t *sim = context;
    return sim->now_us + sim->jumped_us;
}

/* A transfer takes time on the bus, but it never reaches the time of the next row. */
static void spend_bus_time(sim_t *sim, uint64_t ns) {
    uint64_t t_us = sim->now_us + (ns + 999u) / 1000u;
    if (in_run(sim) && next_row_us(sim) < t_us && next_row_us(sim) >= sim->now_us) {
        t_us = next_row_us(sim);
    }
    sim->now_us = t_us;
}

static int bus_write(void *context, uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
    sim_t *sim = context;
    const int taken = is_on(sim, FAULT_STUCK_BUS) ? (int)n : emul_write(&sim->part, sim->now_us, address, reg, data, n);
    spend_bus_time(sim, BUS_BIT_NS * (9u * (n + 2u) + 3u));
    return taken;
}

static int bus_read(void *context, uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
    sim_t *sim = context;
    int given = emul_read(&sim->part, sim->now_us, address, reg, data, n);
    if (is_on(sim, FAULT_STUCK_BUS)) {
        memset(data, 0, n);
        given = (int)n;
    } else if (given > 0 && is_on(sim, FAULT_SHORT_READ)) {
        given--;
    }
    spend_bus_time(sim, BUS_BIT_NS * (9u * (n + 3u) + 3u));
    return given;
}

static int spi(void *context, unsigned die, const gc_spi_t *how, const uint8_t *out, size_t n_out, uint8_t *in, size_t n_in) {
    sim_t *sim = context;
    if (n_in > 0 && is_on(sim, FAULT_STUCK_BUS)) {
        memset(in, 0, n_in);
    } else if (!is_on(sim, FAULT_STUCK_BUS)) {
        emul_spi(&sim->part, sim->now_us, die, how->mode, how->most_hz, out, n_out, in, n_in);
    }
    spend_bus_time(sim, (uint64_t)(8e9 * (double)(n_out + n_in) / how->most_hz) + SPI_SELECT_NS);
    return 0;
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
            exit(0); /* the reader has closed the pipe */
        }
    }
    return done;
}

/* In real time, stdout does not block. A sentence for which there is no room is dropped whole, and the device counts it. */
static int send(void *context, const char *data, size_t n) {
    sim_t *sim = context;
    char line[GC_WIRE_MAX];
    if (is_on(sim, FAULT_BUFFER_FULL)) {
        return 0;
    }
    if (is_on(sim, FAULT_UNHEARD)) {
        const bool fits = sim->rest_n + n <= USB_BYTES;
        if (fits) {
            memcpy(sim->rest + sim->rest_n, data, n);
            sim->rest_n += n;
        }
        return fits ? (int)n : 0;
    }
    if (is_on(sim, FAULT_GARBLED) && n <= sizeof line) {
        memcpy(line, data, n);
        faults_garble(&sim->options.faults, line, n);
        data = line;
    }
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

/* ---- flash ---- */

/* If the power fails during the write, half of the bytes are written and the board's program stops. So many are written too of a
   record that the flash then refuses. */
static int store(void *context, const char *key, const void *data, size_t n) {
    sim_t *sim = context;
    double length_s;
    sim->now_us += FLASH_US;
    const bool lost = begins(sim, FAULT_POWER_LOSS, &length_s);
    const bool fails = is_on(sim, FAULT_FLASH_FAILS);
    const int error = flash_write(&sim->flash, key, data, lost || fails ? n / 2u : n);
    if (lost) {
        longjmp(sim->power_lost, 1);
    }
    return fails ? -1 : error;
}

static int load(void *context, const char *key, void *data, size_t n) {
    return flash_read(&((sim_t *)context)->flash, key, data, n);
}

static const uint8_t *part_file(void *context, const char *part, size_t *n) {
    (void)context;
    return emul_part_file(part, n);
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

static void command_set(sim_t *sim, const char *name, float value, const char *if_nan) {
    char number[ROWS_DECIMAL_MAX], text[GC_COMMAND_MAX];
    rows_decimal(value, number);
    snprintf(text, sizeof text, "set %s %s", name, isnan(value) ? if_nan : number);
    command(sim, text);
}

/* ---- replay ---- */

/* Between runs, the table is at rest in the pose of the next run. */
static void stand_still(sim_t *sim, const rows_run_t *run) {
    rows_row_t row = sim->rows.rows[run->first_row];
    row.world[1] = row.world[2] = row.world[3] = 0;
    feed(sim, sim->now_us, row.world);
}

/* A part whose clock error makes its nominal output data rate equal to the true rate of the rows. */
static double clock_of(const sim_t *sim, double rate_hz) {
    return gc_part_odr_for(sim->options.driver, rate_hz) == rate_hz ? emul_clock_for(&sim->part, rate_hz) : 1.0;
}

static void power_on(sim_t *sim, const gc_device_config_t *config, const rows_run_t *run) {
    sim->past_us += sim->now_us;
    sim->now_us = 0;
    sim->awake_us = 0;
    sim->jumped_us = sim->options.clock_us;
    sim->options.faults.turned_over = false;
    pace_from_here(sim);
    emul_power_on(&sim->part, clock_of(sim, (double)sim->rows.sample_rate_hz), 0, (double)sim->rows.full_scale_dps);
    misbehave(sim);
    stand_still(sim, run);
    gc_device_init(&sim->device, config);
    sim->device.teller.seq = sim->options.seq > 0u ? sim->options.seq : sim->device.teller.seq;
    if (sim->options.bench) {
        return; /* the settings are those of its flash */
    }
    command_set(sim, "full_scale_dps", sim->rows.full_scale_dps, "");
    /* The device refuses this before the FIFO is in use. */
    const bool fast = sim->options.fifo > 0u && sim->rows.sample_rate_hz > FASTEST_SINGLE_HZ;
    command_set(sim, "rate_hz", fast ? FASTEST_SINGLE_HZ : sim->rows.sample_rate_hz, "");
    command_set(sim, "fifo", (float)sim->options.fifo, "");
    if (fast) {
        command_set(sim, "rate_hz", sim->rows.sample_rate_hz, "");
    }
    command(sim, "hello"); /* the sentence at boot came before these settings */
    char text[GC_COMMAND_MAX];
    snprintf(text, sizeof text, "stream %s", sim->options.stream);
    if (strcmp(sim->options.stream, "off") != 0) {
        command(sim, text);
    }
}

static void idle_until(sim_t *sim, uint64_t t_us) {
    const double step_us = (2.0 + sim->options.fifo) * 1e6 / (double)sim->rows.sample_rate_hz;
    while (sim->now_us + (uint64_t)step_us < t_us) {
        hear(sim);
        gc_device_step(&sim->device);
    }
}

static void replay(sim_t *sim, const rows_run_t *run) {
    const rows_row_t *first = &sim->rows.rows[run->first_row];
    uint64_t start_us = sim->now_us;
    if (run->power_on_s * 1e6f > (float)start_us) {
        start_us = (uint64_t)llrint((double)run->power_on_s * 1e6);
    }
    stand_still(sim, run);
    /* The FIFO fills and a reader may be connected, so the device keeps running in state idle. */
    if (sim->options.speed > 0.0 || sim->options.fifo > 0u || sim->options.idle_s > 0.0) {
        idle_until(sim, start_us);
    }
    move_to(sim, start_us);
    static const char *const set_axis[] = {"set axis x", "set axis y", "set axis z"};
    command(sim, set_axis[run->axis]);
    command_set(sim, "table_dps", run->table_dps, "none");
    command_set(sim, "turn_deg", run->turn_deg, "0");
    sim->options.faults.turned_over = false;
    emul_set_fed_only(&sim->part, emul_batches(&sim->part));
    sim->device.sampler.sample_us = emul_batches(&sim->part) ? sim->device.sampler.sample_us : 0u; /* skipped time is no loss */
    command(sim, run->face > 0 ? "start up" : "start down");

    /* Only differences of t_us matter. The first row may have any time. */
    sim->base_us = sim->now_us - first->t_us;
    sim->row = first;
    sim->rows_end = first + run->n_rows;
    if (!sim->begun) {
        sim->begun = true;
        sim->begun_us = sim->past_us + sim->now_us;
    }
    while (in_run(sim)) {
        hear(sim);
        gc_device_step(&sim->device);
        skip_missed_rows(sim);
    }
    command(sim, "stop");
    emul_set_fed_only(&sim->part, false);
}

/* After a loss of power the board starts again, and the current run has ended. */
static void replay_all(sim_t *sim, const gc_device_config_t *config) {
    sim->is_off = true;
    if (setjmp(sim->power_lost) != 0) {
        sim->is_off = true;
        sim->run += sim->replaying ? 1u : 0u;
        sim->replaying = false;
    }
    if (sim->run == sim->rows.n_runs) {
        sim->run--;
        power_on(sim, config, &sim->rows.runs[sim->run]);
        sim->run++;
    }
    for (; sim->run < sim->rows.n_runs; sim->run++) {
        const rows_run_t *run = &sim->rows.runs[sim->run];
        if (sim->is_off || run->power_cycle != run[-1].power_cycle) {
            power_on(sim, config, run);
        }
        sim->is_off = false;
        sim->replaying = true;
        replay(sim, run);
        sim->replaying = false;
        if (sim->run + 1u == sim->rows.n_runs || run->power_cycle != run[1].power_cycle) {
            idle_until(sim, sim->now_us + (uint64_t)(1e6 * sim->options.idle_s));
        }
    }
    if (sim->options.hold) {
        sim->options.speed = sim->options.speed > 0.0 ? sim->options.speed : 1.0;
        pace_from_here(sim);
        while (sim->stdin_open) {
            hear(sim);
            gc_device_step(&sim->device);
        }
    }
}

static void restart(void *context) {
    longjmp(((sim_t *)context)->power_lost, 1);
}

/* A board that nobody turns. `reboot` starts it again, and so does the fault of its power. */
static void lie_on_bench(sim_t *sim, const gc_device_config_t *config) {
    sim->begun = true;
    (void)setjmp(sim->power_lost);
    power_on(sim, config, &sim->rows.runs[0]);
    while (sim->stdin_open) {
        hear(sim);
        gc_device_step(&sim->device);
    }
}

/* Faults that show by what is in flash after them. */
static bool has_flash(const faults_t *faults) {
    static const fault_kind_t of_flash[] = {FAULT_POWER_LOSS, FAULT_HANG, FAULT_SUPPLY, FAULT_FLASH_FAILS};
    for (size_t i = 0; i < sizeof of_flash / sizeof of_flash[0]; i++) {
        if (faults_has(faults, of_flash[i])) {
            return true;
        }
    }
    return false;
}

static int stdout_flags;

static void restore_stdout(void) {
    fcntl(STDOUT_FILENO, F_SETFL, stdout_flags);
}

int main(int argc, char **argv) {
    static sim_t sim;
    const options_t *options = &sim.options;
    const char *wrong = options_parse(&sim.options, argc, argv);
    if (wrong != NULL) {
        fprintf(stderr, "gyrocal-sim: %s; %s\n", wrong, OPTIONS_USAGE);
        return 2;
    }
    if (options_list(options, stdout)) {
        return 0;
    }
    sim.stdin_open = true;
    sim.part.kind = options->sensor;
    wrong = rows_load(&sim.rows, options->path, options->driver);
    if (wrong != NULL) {
        fprintf(stderr, "gyrocal-sim: %s: %s\n", options->path, wrong);
        return 2;
    }
    stdout_flags = fcntl(STDOUT_FILENO, F_GETFL);
    /* Faster than real time, the simulator waits for its reader. */
    if (options->speed > 0.0 && options->speed <= 1.0 && stdout_flags >= 0) {
        fcntl(STDOUT_FILENO, F_SETFL, stdout_flags | O_NONBLOCK);
        atexit(restore_stdout);
    }

    const gc_port_t port = {
        .context = &sim,
        .bus_write = bus_write, .bus_read = bus_read, .spi = options->spi ? spi : NULL,
        .now_us = now_us, .wait_until_us = wait_until_us, .wait_sample_us = wait_sample_us,
        .send = send,
        /* Otherwise each power cycle begins with empty flash. */
        .store = options->bench || has_flash(&options->faults) ? store : NULL,
        .load = load,
        .part_file = part_file,
        .restart = options->bench ? restart : NULL,
    };
    const gc_device_config_t config = {
        .port = &port,
        .part = options->told, .parts = PARTS, .address = options->sensor->address,
        .imu = options->imu,
        .calibration = &gc_calibration,
        .net = &gc_net,
    };
    (options->bench ? lie_on_bench : replay_all)(&sim, &config);
    if (sim.missed > 0) {
        fprintf(stderr, "gyrocal-sim: %lu rows were not read: the sensor was being set up or the board was busy\n", sim.missed);
    }
    rows_free(&sim.rows);
    return 0;
}
