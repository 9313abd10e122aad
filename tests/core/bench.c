/* A bench for the device: a script on stdin, what the device says on stdout.
 *
 *     > TEXT                     a command to the device
 *     world T GX GY GZ AX AY AZ  what there is to measure, raw counts at 250 dps and 2 g
 *     noise SD                   white noise on the gyroscope, counts
 *     run SECONDS                steps of the device until so much virtual time has passed
 *     sync SECONDS               the same until the device's clock stands at SECONDS
 *     power                      a fresh device; what it stored is still there
 *     fault NAME on|off          nack, short, wrong_id, stale, stuck_bit, stuck_reset, bad_tags, stuck_mass; brownout happens once
 *     drop N                     the next N sentences find no room
 *     store on|fails|torn        torn: half of a record is written, and the write then fails
 *     wear                       prints the records that were written since the last `wear`, and their bytes
 *     cut N PERCENT              the power fails in the Nth store from now, after so much of it; then nothing until `power`
 *     line on                    INT1 is wired
 *     busy SECONDS               the board does something else
 *     clock FACTOR               the chip's clock, from the next power-on
 */
#include "calibration.h"
#include "emul_lsm6dso.h"
#include "gc_device.h"
#include "gc_lsm6dso.h"
#include "weights.h"

#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static uint64_t now;
static emul_lsm6dso_t chip;
static gc_device_t device;
static int16_t world[EMUL_WORDS];
static double noise;
static int drop;
static bool short_reads;
static char store_mode = 'o';
static int cut, cut_percent;
static bool is_off;
static jmp_buf power_lost;
static struct {
    char key[16];
    char data[4096];
    size_t n;
} kept[6];
static struct {
    unsigned long records, bytes;
} written;
static uint32_t lcg = 1;
static double chip_clock = 1.0;

static double gaussian(void) {
    double sum = -6.0;
    for (int i = 0; i < 12; i++) {
        lcg = lcg * 1664525u + 1013904223u;
        sum += (double)lcg / 4294967296.0;
    }
    return sum;
}

static void stir(void) {
    memcpy(chip.world, world, sizeof world);
    for (int i = 1; i <= 3 && noise > 0.0; i++) {
        chip.world[i] = (int16_t)(world[i] + (int)(noise * gaussian() + (world[i] >= 0 ? 0.5 : -0.5)));
    }
}

static void wait_until_us(void *context, uint64_t t_us) {
    (void)context;
    double tick_us = -1.0;
    while (chip.tick_us > tick_us && chip.tick_us <= (double)t_us) { /* each sample has a noise of its own */
        tick_us = chip.tick_us;
        stir();
        emul_lsm6dso_advance(&chip, (uint64_t)tick_us + 1u);
    }
    now = t_us > now ? t_us : now;
    stir();
    emul_lsm6dso_advance(&chip, now);
}

static uint64_t now_us(void *context) {
    (void)context;
    return now;
}

static int bus_write(void *context, uint8_t address, uint8_t reg, const uint8_t *data, size_t n) {
    (void)context;
    wait_until_us(NULL, now + 70);
    return address == GC_LSM6DSO_ADDRESS ? emul_lsm6dso_write(&chip, now, reg, data, n) : -1;
}

static int bus_read(void *context, uint8_t address, uint8_t reg, uint8_t *data, size_t n) {
    (void)context;
    wait_until_us(NULL, now + 30 + 23 * n);
    const int got = address == GC_LSM6DSO_ADDRESS ? emul_lsm6dso_read(&chip, now, reg, data, n) : -1;
    return got > 1 && short_reads ? got - 1 : got;
}

static int send(void *context, const char *data, size_t n) {
    (void)context;
    if (drop > 0) {
        drop--;
        return 0;
    }
    fwrite(data, 1, n, stdout);
    return (int)n;
}

static int store(void *context, const char *key, const void *data, size_t n) {
    (void)context;
    for (size_t i = 0; i < sizeof kept / sizeof kept[0]; i++) {
        if (store_mode != 'f' && n <= sizeof kept[i].data && (kept[i].n == 0 || strcmp(kept[i].key, key) == 0)) {
            const bool fails = cut > 0 && --cut == 0;
            const size_t done = fails ? n * (size_t)cut_percent / 100u : store_mode == 't' ? n / 2u : n;
            strcpy(kept[i].key, key);
            memcpy(kept[i].data, data, done);
            kept[i].n = done > kept[i].n ? done : kept[i].n;
            if (fails) {
                longjmp(power_lost, 1);
            }
            if (store_mode == 't') {
                return -1;
            }
            written.records++;
            written.bytes += n;
            printf("# store %s\n", key);
            return 0;
        }
    }
    return -1;
}

static int load(void *context, const char *key, void *data, size_t n) {
    (void)context;
    for (size_t i = 0; i < sizeof kept / sizeof kept[0]; i++) {
        if (kept[i].n > 0 && kept[i].n <= n && strcmp(kept[i].key, key) == 0) {
            memcpy(data, kept[i].data, kept[i].n);
            return (int)kept[i].n;
        }
    }
    return -1;
}

static void led(void *context, gc_led_t state) {
    static const char *const names[] = {"idle", "recording", "flip", "done", "misfit"};
    (void)context;
    printf("# led %s\n", names[state]);
}

/* INT1 is high while the chip has data and was told to say so. */
static uint64_t wait_ready_us(void *context, uint64_t deadline_us) {
    while (now < deadline_us && !emul_lsm6dso_int1(&chip)) {
        wait_until_us(context, now + 1);
    }
    return 0;
}

static gc_port_t port = {
    .bus_write = bus_write,
    .bus_read = bus_read,
    .now_us = now_us,
    .wait_until_us = wait_until_us,
    .send = send,
    .store = store,
    .load = load,
    .led = led,
};

static void power_on(void) {
    static const gc_device_config_t config = {
        .port = &port, .part = &gc_lsm6dso, .address = GC_LSM6DSO_ADDRESS, .calibration = &gc_calibration, .net = &gc_net};
    const emul_lsm6dso_t before = chip;
    now = 0;
    chip.clock = chip_clock;
    emul_lsm6dso_power_on(&chip, now, 250.0);
    chip.wrong_id = before.wrong_id;
    chip.stuck_reset = before.stuck_reset;
    chip.stuck_bit = before.stuck_bit;
    stir();
    gc_device_init(&device, &config);
}

static bool set_fault(const char *name, bool on) {
    struct {
        const char *name;
        bool *flag;
    } const flags[] = {{"nack", &chip.nack},   {"short", &short_reads},         {"wrong_id", &chip.wrong_id},
                       {"bad_tags", &chip.bad_tags},
                       {"stale", &chip.stale}, {"stuck_bit", &chip.stuck_bit}, {"stuck_reset", &chip.stuck_reset}};
    for (size_t i = 0; i < sizeof flags / sizeof flags[0]; i++) {
        if (strcmp(name, flags[i].name) == 0) {
            *flags[i].flag = on;
            return true;
        }
    }
    if (strcmp(name, "stuck_mass") == 0) {
        chip.stuck_axes = on ? EMUL_ALL_AXES : 0u;
        return true;
    }
    if (strcmp(name, "brownout") == 0) {
        emul_lsm6dso_brown_out(&chip);
        return true;
    }
    return false;
}

/* Writes a value into what is kept, as a firmware of another kind would: whole, and with the right CRC. */
static bool forge(const char *field, int32_t value) {
    for (size_t i = 0; i < sizeof kept / sizeof kept[0]; i++) {
        static gc_results_t results;
        if (strncmp(kept[i].key, "results", 7) != 0 || kept[i].n != sizeof results) {
            continue;
        }
        memcpy(&results, kept[i].data, sizeof results);
        if (strcmp(field, "method") == 0) {
            results.answer[0].method = value;
        } else if (strcmp(field, "axis") == 0) {
            results.answer[0].axis = value;
        } else if (strcmp(field, "net") == 0) {
            results.net = (uint32_t)value;
        } else {
            return false;
        }
        results.record.crc = gc_crc32(0, (const char *)&results + sizeof results.record.crc, sizeof results - sizeof results.record.crc);
        memcpy(kept[i].data, &results, sizeof results);
    }
    return true;
}

static bool obey(char *line) {
    char word[32], flag[8];
    double number;
    int w[EMUL_WORDS];
    if (strncmp(line, "> ", 2) == 0) {
        gc_device_receive(&device, line + 2, strlen(line + 2));
        return true;
    }
    if (sscanf(line, "world %d %d %d %d %d %d %d", &w[0], &w[1], &w[2], &w[3], &w[4], &w[5], &w[6]) == 7) {
        for (int i = 0; i < EMUL_WORDS; i++) {
            world[i] = (int16_t)w[i];
        }
        return true;
    }
    if (sscanf(line, "noise %lf", &noise) == 1 || sscanf(line, "drop %d", &drop) == 1) {
        return true;
    }
    if (sscanf(line, "run %lf", &number) == 1 || sscanf(line, "sync %lf", &number) == 1) {
        const uint64_t end = (line[0] == 'r' ? now : 0) + (uint64_t)(number * 1e6);
        while (now < end) {
            gc_device_step(&device);
        }
        return true;
    }
    if (sscanf(line, "busy %lf", &number) == 1) {
        wait_until_us(NULL, now + (uint64_t)(number * 1e6));
        return true;
    }
    if (sscanf(line, "back %lf", &number) == 1) {
        now -= (uint64_t)(number * 1e6);
        return true;
    }
    if (sscanf(line, "forge %31s %lf", word, &number) == 2) {
        return forge(word, (int32_t)number);
    }
    if (sscanf(line, "clock %lf", &chip_clock) == 1) {
        return true;
    }
    if (sscanf(line, "cut %d %d", &cut, &cut_percent) == 2) {
        return true;
    }
    if (sscanf(line, "store %7s", word) == 1) {
        store_mode = word[0];
        return true;
    }
    if (strncmp(line, "wear", 4) == 0) {
        printf("# wear %lu %lu\n", written.records, written.bytes);
        written.records = 0;
        written.bytes = 0;
        return true;
    }
    if (strncmp(line, "line on", 7) == 0) {
        port.wait_ready_us = wait_ready_us;
        return true;
    }
    if (sscanf(line, "fault %31s %7s", word, flag) == 2) {
        return set_fault(word, strcmp(flag, "on") == 0);
    }
    return false;
}

int main(void) {
    char line[4096];
    while (fgets(line, sizeof line, stdin) != NULL) {
        if (setjmp(power_lost) != 0) {
            is_off = true;
            continue;
        }
        if (strncmp(line, "power", 5) == 0) {
            is_off = false;
            power_on();
        } else if (!is_off && !obey(line)) {
            fprintf(stderr, "bench: cannot read: %s", line);
            return 2;
        }
    }
    return 0;
}
