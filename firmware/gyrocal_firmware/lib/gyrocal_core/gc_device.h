/* The calibrator of one sensor. It takes samples, collects them into runs, estimates, judges and sends the answers.
 *
 *     gc_device_init(&device, &config);          sets the sensor up, sends a hello
 *     for (;;) {
 *         gc_device_receive(&device, bytes, n);  commands, as they come
 *         gc_device_step(&device);               waits for one sample and deals with it
 *     }
 *
 * All three must be called from one task. PROTOCOL.md describes sentences and commands. Each member of gc_device_t except the
 * last few belongs to a module below this one; gc_device.c connects them and carries out the commands.
 */
#ifndef GC_DEVICE_H
#define GC_DEVICE_H

#include "gc_calibration.h"
#include "gc_cnn.h"
#include "gc_command.h"
#include "gc_kept.h"
#include "gc_port.h"
#include "gc_recorder.h"
#include "gc_sampler.h"
#include "gc_sensor.h"
#include "gc_settings.h"
#include "gc_stream.h"
#include "gc_tell.h"
#include "gc_watch.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GC_FIRMWARE_VERSION "0.2.0"

typedef struct {
    const gc_port_t *port;
    const gc_part_t *part; /* the kind of sensor; NULL = the one of `parts` that its id or the setting `sensor` tells */
    const gc_part_t *const *parts; /* such as gc_parts (gc_parts.h); NULL where there is `part` */
    uint8_t address;       /* address of the sensor on its bus */
    unsigned imu;          /* its number on the wire */
    const gc_calibration_t *calibration; /* may be NULL */
    const gc_cnn_net_t *net;             /* may be NULL */
} gc_device_config_t;

typedef struct {
    gc_device_config_t config;
    gc_teller_t teller;
    gc_line_reader_t reader; /* of commands */
    char line[GC_COMMAND_MAX];
    gc_kept_settings_t settings;
    bool settings_changed; /* not stored yet, because of a run: of this device, or of another of the board */
    bool results_changed;  /* likewise */
    bool settings_kept;    /* the store has them as they are */
    uint64_t store_by_us;  /* they are stored from this time on, whatever other devices do */
    gc_kept_t kept;
    gc_sampler_t sampler;
    gc_watch_t watch;
    gc_recorder_t recorder;

    gc_stream_t stream;
    uint32_t slowest_us;  /* the longest time from a sample's turn until all was done with it */
    unsigned reminders;   /* number of $STA that still follow the end of the last run, */
    uint64_t reminder_us; /* the next one not before this time */
    gc_led_t led;
    bool led_known;
} gc_device_t;

/* config and what it points to must outlive the device; the device must stay where it is. The failure of a sensor is
   reported on the wire, and the sensor is set up again. */
void gc_device_init(gc_device_t *device, const gc_device_config_t *config);
void gc_device_receive(gc_device_t *device, const char *data, size_t n);
void gc_device_step(gc_device_t *device);
/* Returns whether a run goes on, so that a board with several devices knows when it may write its flash. */
bool gc_device_is_recording(const gc_device_t *device);

#ifdef __cplusplus
}
#endif

#endif
