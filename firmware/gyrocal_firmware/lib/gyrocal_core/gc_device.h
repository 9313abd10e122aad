/* The calibrator itself: sample -> run -> estimate -> judge -> send, for one sensor.
 *
 *     gc_device_init(&device, &config);          sets the sensor up, says hello
 *     for (;;) {
 *         gc_device_receive(&device, bytes, n);  commands, as they come
 *         gc_device_step(&device);               waits for one sample and deals with it
 *     }
 *
 * All three from one task. PROTOCOL.md tells what is said and heard.
 */
#ifndef GC_DEVICE_H
#define GC_DEVICE_H

#include "gc_baseline.h"
#include "gc_calibration.h"
#include "gc_cnn.h"
#include "gc_convnet.h"
#include "gc_estimator.h"
#include "gc_kept.h"
#include "gc_lsm6dso.h"
#include "gc_port.h"
#include "gc_wire.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GC_FIRMWARE_VERSION "0.1.0"
#define GC_COMMAND_MAX 80

#ifndef GC_MAX_CNN_SCRATCH
#define GC_MAX_CNN_SCRATCH 1024 /* floats */
#endif

#define GC_GAP_PERIODS 1.5 /* two samples that are further apart have lost one between them */
/* A misfit above this says that the readings do not fit: 2.5 standard deviations of what `blocks` of noise alone show. */
#define GC_MISFIT_LIMIT(blocks) (1.0 + 2.5 / sqrt(2.0 * (blocks)))

typedef struct {
    const gc_port_t *port;
    uint8_t address; /* of the sensor on its bus */
    unsigned imu;    /* its number on the wire */
    const gc_calibration_t *calibration; /* may be NULL */
    const gc_cnn_net_t *net;             /* may be NULL */
} gc_device_config_t;

typedef struct {
    double rate_hz;
    double full_scale_dps;
    double table_dps; /* NaN = unknown */
    double turn_deg;  /* 0 = none */
    double fifo;      /* samples taken at once out of the sensor's FIFO; 0 = each as it comes */
    int32_t axis;     /* 0 x, 1 y, 2 z */
    int32_t automatic;
} gc_settings_t;

typedef enum { GC_STATE_IDLE, GC_STATE_RECORDING, GC_STATE_FLIP, GC_STATE_DONE } gc_state_t;
typedef enum { GC_STREAM_OFF, GC_STREAM_RAW, GC_STREAM_TELEPLOT, GC_STREAM_CORRECTED } gc_stream_t;

typedef struct {
    gc_record_t record;
    gc_settings_t settings;
} gc_kept_settings_t;

typedef struct {
    bool complete; /* ended, long enough and in the right direction: half of a pair */
    bool opposed;  /* it turned against its true rate */
    bool clip_told;
    bool automatic;
    int face;      /* +1 up, -1 down */
    gc_settings_t settings;
    double lsb_dps;
    double w_dps;      /* true rate about the sensed axis; NaN = unknown */
    uint32_t n;
    uint64_t first;    /* sample number since boot */
    uint64_t first_us;
    uint64_t last_us;
    int16_t last[3];
    int64_t sum[3];
    int64_t sum_sq_diff[3];
    int64_t acc_sum[3];
    int64_t temp_sum;
    int64_t turn;      /* trapezoid of the axis, 2 counts x microseconds */
    uint32_t clipped;
    uint32_t missed; /* samples that never came, by the time between those that did */
    uint16_t bits_or, bits_and; /* of the axis: a bit that never changes */
    int16_t min, max;
    uint32_t changes;
    gc_baseline_t baseline;
    uint32_t n_at[GC_CHECKPOINTS];
    int64_t temp_at[GC_CHECKPOINTS];
} gc_run_t;

/* What the last run at rest tells of an axis. */
typedef struct {
    bool known;
    double bias_dps;
    double white_variance; /* of one sample, dps^2 */
    double bias_variance;
} gc_rest_t;

enum { GC_SLOT_POSITIVE, GC_SLOT_NEGATIVE, GC_SLOT_OTHER, GC_SLOTS }; /* by the sign of the true rate */

typedef struct {
    gc_device_config_t config;
    gc_settings_t settings;
    gc_kept_settings_t kept_settings;
    gc_results_t results;
    gc_windows_t windows;
    bool results_changed, windows_changed;
    bool first_answer; /* of this pair */
    uint32_t dump_line, dump_lines;

    gc_lsm6dso_t sensor;
    bool sensor_ready;
    int sensor_error;  /* of the episode that goes on, told once */
    uint64_t good_us;  /* last time that a sample came */
    uint64_t retry_us;
    uint64_t epoch_us; /* ticks of the sample timer are counted from here */
    uint64_t tick;     /* the last that was sampled */
    uint64_t samples;  /* since boot */
    uint64_t sample_us; /* of the last one; 0 = none at these settings */

    gc_lsm6dso_batch_t batch;
    bool fifo_known;   /* when its last sample was taken, and that none is missing since: */
    double fifo_us;

    uint32_t seq, lost, stale, resets, missed, overruns;
    double misfit;
    bool misfits; /* that is above its limit */
    gc_stream_t stream;
    gc_led_t led;
    bool led_known;
    gc_line_reader_t reader;
    char command[GC_COMMAND_MAX + 1];

    bool recording;
    bool paired; /* the run in progress has a partner */
    unsigned slot;
    gc_run_t run[GC_SLOTS];
    gc_rest_t rest[3];

    bool steady, armed; /* automatic start */
    uint64_t steady_since_us;

    bool model; /* the calibration has one that can be used */
    int model_error;
    gc_estimator_t estimator;
    gc_marginal_t first_run[GC_CHECKPOINTS];
    gc_solution_t solution; /* in progress, a part a sample: */
    bool solving;
    unsigned solved; /* the checkpoint that it is for */

    bool range_told; /* readings beyond the network's range, in this pair */
    bool cnn_off; /* an error was told for this pair */
    unsigned cnn_next, cnn_windows;
    double cnn_sum[2];
    bool cnn_half; /* of network gyrocal's next answer one face is done: */
    gc_convnet_face_t cnn_face;
    float cnn_up[GC_MAX_CNN_WINDOW], cnn_down[GC_MAX_CNN_WINDOW], cnn_scratch[GC_MAX_CNN_SCRATCH];

    gc_sentence_t sentence;
} gc_device_t;

/* config and what it points to must outlive the device. A sensor that fails is told on the wire and tried again. */
void gc_device_init(gc_device_t *device, const gc_device_config_t *config);
void gc_device_receive(gc_device_t *device, const char *data, size_t n);
void gc_device_step(gc_device_t *device);
gc_state_t gc_device_state(const gc_device_t *device);

#ifdef __cplusplus
}
#endif

#endif
