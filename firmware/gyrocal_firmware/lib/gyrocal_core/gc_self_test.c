#include "gc_self_test.h"

#include "gc_error.h"

#include <math.h>

#define LONGEST_SAMPLE_US 200000u /* between two samples */
#define LOOK_US 200u
/* InvenSense's limits, by the sources that the headers of its drivers name. */
#define CODE_1_DPS 20.0 /* the change at the factory that code 1 stands for */
#define CODE_STEP 1.01  /* between two codes */
#define LEAST_SHARE 0.5
#define LEAST_WITHOUT_CODE_DPS 60.0
#define REST_MOST_DPS 20.0

static int wait_for_sample(gc_sensor_t *sensor, gc_sample_t *sample) {
    const uint64_t start = sensor->port->now_us(sensor->port->context);
    int ready = sensor->part->ready(sensor);
    while (ready == 0) {
        if (sensor->port->now_us(sensor->port->context) - start > LONGEST_SAMPLE_US) {
            return GC_E_STALE;
        }
        gc_sensor_wait_us(sensor, LOOK_US);
        ready = sensor->part->ready(sensor);
    }
    return ready < 0 ? ready : sensor->part->read(sensor, sample);
}

/* The mean of new readings of the gyroscope in counts, after one that is discarded. */
static int mean_rate(gc_sensor_t *sensor, unsigned n, double mean[3]) {
    gc_sample_t sample;
    double sum[3] = {0.0, 0.0, 0.0};
    int error = wait_for_sample(sensor, &sample);
    for (unsigned k = 0; k < n && error == GC_OK; k++) {
        error = wait_for_sample(sensor, &sample);
        for (size_t i = 0; i < 3u && error == GC_OK; i++) {
            sum[i] += sample.gyro[i];
        }
    }
    for (size_t i = 0; i < 3u; i++) {
        mean[i] = sum[i] / n;
    }
    return error;
}

int gc_self_test_by_change(gc_sensor_t *sensor, const gc_moving_test_t *test, gc_self_test_t *result) {
    double before[3], moved[3];
    int error = gc_sensor_write_steps(sensor, test->still, test->stills);
    gc_sensor_wait_us(sensor, test->settle_us);
    if (error == GC_OK) {
        error = mean_rate(sensor, test->samples, before);
    }
    if (error == GC_OK) {
        error = gc_sensor_write_steps(sensor, test->moving, test->movings);
    }
    gc_sensor_wait_us(sensor, test->settle_us);
    if (error == GC_OK) {
        error = mean_rate(sensor, test->samples, moved);
    }
    if (error != GC_OK) {
        return error;
    }
    result->passed = true;
    for (size_t i = 0; i < 3u; i++) {
        const double change_dps = test->lsb_dps * (moved[i] - before[i]);
        result->change_dps[i] = change_dps;
        result->rest_dps[i] = test->lsb_dps * before[i];
        result->passed = result->passed && fabs(change_dps) >= result->least_dps[i] && !(fabs(change_dps) > result->most_dps[i]) &&
                         !(fabs(result->rest_dps[i]) > result->rest_most_dps);
    }
    return GC_OK;
}

void gc_self_test_limit(gc_self_test_t *result, double least_dps, double most_dps) {
    for (size_t i = 0; i < 3u; i++) {
        result->least_dps[i] = least_dps;
        result->most_dps[i] = most_dps;
    }
}

void gc_self_test_limit_by_code(gc_self_test_t *result, const uint8_t code[3]) {
    for (size_t i = 0; i < 3u; i++) {
        result->least_dps[i] = code[i] > 0u ? LEAST_SHARE * CODE_1_DPS : LEAST_WITHOUT_CODE_DPS;
        for (uint8_t k = 1; k < code[i]; k++) {
            result->least_dps[i] *= CODE_STEP;
        }
    }
    result->rest_most_dps = REST_MOST_DPS;
}
