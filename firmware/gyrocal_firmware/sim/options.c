#include "options.h"

#include "gc_error.h"
#include "gc_format.h"
#include "part.h"

#include <string.h>

/* The driver of a kind has its name. */
static const char *choose_sensor(options_t *options, const char *name) {
    size_t i = 0;
    options->sensor = emul_kind(name);
    while (PARTS[i] != NULL && strcmp(PARTS[i]->name, name) != 0) {
        i++;
    }
    options->driver = PARTS[i];
    if (options->sensor == NULL || options->driver == NULL) {
        return "--sensor takes the name of a sensor such as MPU-6050";
    }
    for (i = 0; PARTS[i]->id != options->driver->id || PARTS[i]->address[0] != options->driver->address[0]; i++) {
    }
    options->told = PARTS[i] == options->driver ? NULL : options->driver;
    return NULL;
}

static const char *parse_option(options_t *options, const char *name, const char *value) {
    uint64_t number;
    if (strcmp(name, "--speed") == 0) {
        options->speed = 0.0;
        if (strcmp(value, "max") != 0 &&
            (gc_parse_real(value, strlen(value), &options->speed) != GC_OK || !(options->speed > 0.0))) {
            return "--speed takes a positive number or max";
        }
    } else if (strcmp(name, "--imu") == 0) {
        if (gc_parse_uint(value, strlen(value), &number) != GC_OK || number > 255) {
            return "--imu takes a number within 0 and 255";
        }
        options->imu = (unsigned)number;
    } else if (strcmp(name, "--stream") == 0) {
        if (strcmp(value, "raw") != 0 && strcmp(value, "packed") != 0 && strcmp(value, "off") != 0) {
            return "--stream takes raw, packed or off";
        }
        options->stream = value;
    } else if (strcmp(name, "--fifo") == 0) {
        if (gc_parse_uint(value, strlen(value), &number) != GC_OK || number > GC_BATCH_MAX) {
            return "--fifo takes a number of samples, 128 at most";
        }
        options->fifo = (unsigned)number;
    } else if (strcmp(name, "--idle") == 0) {
        if (gc_parse_real(value, strlen(value), &options->idle_s) != GC_OK || !(options->idle_s >= 0.0)) {
            return "--idle takes a number of seconds";
        }
    } else if (strcmp(name, "--sleep") == 0) {
        if (gc_parse_uint(value, strlen(value), &number) != GC_OK || number > 60000u) {
            return "--sleep takes milliseconds, 60000 at most";
        }
        options->sleep_us = 1000u * number;
    } else if (strcmp(name, "--clock") == 0) {
        if (gc_parse_uint(value, strlen(value), &number) != GC_OK || number > UINT64_MAX / 2u) {
            return "--clock takes microseconds";
        }
        options->clock_us = number;
    } else if (strcmp(name, "--seq") == 0) {
        if (gc_parse_uint(value, strlen(value), &number) != GC_OK || number > UINT32_MAX) {
            return "--seq takes a number below 2^32";
        }
        options->seq = (uint32_t)number;
    } else if (strcmp(name, "--sensor") == 0) {
        options->list_sensors = strcmp(value, "list") == 0;
        return options->list_sensors ? NULL : choose_sensor(options, value);
    } else if (strcmp(name, "--bus") == 0) {
        options->spi = strcmp(value, "spi") == 0;
        if (!options->spi && strcmp(value, "i2c") != 0) {
            return "--bus takes i2c or spi";
        }
    } else if (strcmp(name, "--fault") == 0) {
        options->list_faults = options->list_faults || strcmp(value, "list") == 0;
        return strcmp(value, "list") == 0 ? NULL : faults_add(&options->faults, value);
    } else {
        return "no such option";
    }
    return NULL;
}

const char *options_parse(options_t *options, int argc, char **argv) {
    options->speed = 1.0;
    options->stream = "off";
    (void)choose_sensor(options, emul_kinds[0].name);
    for (int i = 1; i < argc; i++) {
        const char *wrong = NULL;
        if (strcmp(argv[i], "--hold") == 0) {
            options->hold = true;
        } else if (strcmp(argv[i], "--bench") == 0) {
            options->bench = true;
        } else if (argv[i][0] == '-') {
            const char *name = argv[i];
            wrong = parse_option(options, name, ++i < argc ? argv[i] : "");
        } else if (options->path != NULL) {
            wrong = "more than one ROWS file";
        } else {
            options->path = argv[i];
        }
        if (wrong != NULL) {
            return wrong;
        }
    }
    if (options->path == NULL && !options->list_faults && !options->list_sensors) {
        return "no ROWS file";
    }
    if (options->fifo > options->driver->batch_max) {
        return "the FIFO of this sensor is not used: leave --fifo out";
    }
    if (options->spi && options->driver->spi[0] == NULL) {
        return "this sensor does not speak SPI: leave --bus out";
    }
    if (options->spi && faults_has(&options->faults, FAULT_SHORT_READ)) {
        return "short_read is a fault of I2C: leave --bus out";
    }
    if (faults_has(&options->faults, FAULT_BAD_TAGS) && options->fifo == 0u) {
        return "bad_tags is a fault of the FIFO: give --fifo";
    }
    return NULL;
}

bool options_list(const options_t *options, FILE *to) {
    if (options->list_faults) {
        faults_list(to);
    } else if (options->list_sensors) {
        for (const emul_kind_t *kind = emul_kinds; kind->name != NULL; kind++) {
            fprintf(to, "%s\n", kind->name);
        }
    }
    return options->list_faults || options->list_sensors;
}
