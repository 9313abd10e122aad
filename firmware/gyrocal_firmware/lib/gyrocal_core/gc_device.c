#include "gc_device.h"

#include "gc_error.h"
#include "gc_format.h"

#include <math.h>
#include <string.h>

#define NET_ROOM 20u /* bytes of a name in $HEL; longer names are cut */
#define REMINDERS 3u             /* after the end of a run, for a reader who missed it; chosen by judgement */
#define REMINDER_US 1000000u
#define STORE_WITHIN_US 120000000u /* of the end of a run, though others go on; chosen by judgement */

static uint64_t now_us(const gc_device_t *d) {
    return d->config.port->now_us(d->config.port->context);
}

static bool is_recording(const gc_device_t *d) {
    return d->state == GC_STATE_RECORDING;
}

/* The state stays the same if the trigger is refused. */
static void enter(gc_device_t *d, gc_trigger_t trigger) {
    const int next = gc_state_next(d->state, trigger);
    d->state = next < 0 ? d->state : (gc_state_t)next;
}

/* ---- sentences ---- */

void gc_device_hello(gc_device_t *d) {
    const gc_part_t *part = d->sampler.part;
    const gc_settings_t *settings = &d->settings.now;
    gc_sentence_t *s = gc_tell_begin(&d->teller, "HEL");
    gc_sentence_uint(s, "proto", GC_WIRE_PROTOCOL);
    gc_sentence_text(s, "fw", GC_FIRMWARE_VERSION);
    gc_sentence_text(s, "sensor", part->name);
    gc_settings_field(s, settings, GC_SETTING_RATE_HZ, d->config.parts);
    gc_sentence_real(s, "odr_hz", d->sampler.sensor.odr_hz);
    gc_settings_field(s, settings, GC_SETTING_FULL_SCALE_DPS, d->config.parts);
    gc_sentence_real(s, "lsb_dps", d->sampler.sensor.lsb_dps);
    gc_sentence_real(s, "lsb_g", part->lsb_g);
    gc_sentence_real(s, "lsb_c", part->lsb_c);
    gc_sentence_real(s, "zero_c", part->zero_c);
    gc_sentence_real(s, "noise_dps", part->noise_dps);
    gc_settings_field(s, settings, GC_SETTING_AXIS, d->config.parts);
    gc_settings_field(s, settings, GC_SETTING_TABLE_DPS, d->config.parts);
    gc_settings_field(s, settings, GC_SETTING_TURN_DEG, d->config.parts);
    gc_sentence_text_cut(s, "cal", d->config.calibration != NULL ? d->config.calibration->name : NULL, NET_ROOM);
    gc_sentence_text_cut(s, "net", d->pair.net.name, 0);
    gc_tell_end(&d->teller);
}

static const char *waits_for(const gc_device_t *d) {
    if (!d->sampler.ready) {
        return "sensor";
    }
    if (is_recording(d)) {
        return d->run->automatic ? "unsteady" : "stop";
    }
    if (!d->settings.now.automatic) {
        return "start";
    }
    if (!d->watch.armed) {
        return "unsteady";
    }
    return d->state == GC_STATE_FLIP ? "flip" : "steady";
}

static void tell_load(const gc_device_t *d, gc_sentence_t *s) {
    const gc_port_t *port = d->config.port;
    gc_sentence_uint(s, "slowest_us", d->slowest_us);
    if (port->least_free != NULL) {
        uint32_t heap_bytes = 0, stack_bytes = 0;
        port->least_free(port->context, &heap_bytes, &stack_bytes);
        gc_sentence_uint(s, "heap_bytes", heap_bytes);
        gc_sentence_uint(s, "stack_bytes", stack_bytes);
    }
}

static void begin_status(gc_device_t *d) {
    gc_sentence_t *s = gc_tell_begin(&d->teller, "STA");
    gc_sentence_text(s, "state", gc_state_name(d->state));
    gc_sentence_text(s, "face", is_recording(d) ? gc_face_name(d->run->face) : NULL);
    gc_sentence_uint(s, "n", is_recording(d) ? d->run->n : 0u);
    gc_sentence_uint(s, "lost", d->teller.lost);
    gc_sentence_uint(s, "stale", d->sampler.stale);
    gc_sentence_uint(s, "resets", d->sampler.resets);
    gc_sentence_uint(s, "missed", d->sampler.missed);
    gc_sentence_uint(s, "overruns", d->sampler.overruns);
    gc_sentence_real(s, "misfit", d->verdict.misfit);
    gc_sentence_text(s, "waits", waits_for(d));
    gc_sentence_real(s, "rate_dps", d->watch.rate_dps);
    gc_sentence_text(s, "gravity", d->watch.face != 0 ? gc_face_name(d->watch.face) : NULL);
    if (d->run != NULL) {
        gc_sentence_uint(s, "run_first", d->run->first);
        gc_sentence_uint(s, "run_n", d->run->n);
    }
    tell_load(d, s);
}

void gc_device_status(gc_device_t *d) {
    begin_status(d);
    gc_tell_end(&d->teller);
}

/* A reader who missed the end of a run learns from these how many samples it had. */
static void remind(gc_device_t *d) {
    const uint64_t now = now_us(d);
    if (d->reminders == 0u || d->stream != GC_STREAM_RAW || is_recording(d) || now < d->reminder_us) {
        return;
    }
    begin_status(d);
    if (gc_tell_end_or_wait(&d->teller)) {
        d->reminders--;
        d->reminder_us = now + REMINDER_US;
    }
}

static void tell_teleplot(gc_device_t *d, const gc_sample_t *sample) {
    char text[3 * (6 + GC_FORMAT_MAX)];
    size_t n = 0;
    for (int i = 0; i < 3; i++) {
        text[n++] = '>';
        text[n++] = 'g';
        text[n++] = *gc_axis_name(i);
        text[n++] = ':';
        n += gc_format_real(d->sampler.sensor.lsb_dps * sample->gyro[i], text + n);
        text[n++] = '\n';
    }
    (void)d->config.port->send(d->config.port->context, text, n);
}

static void tell_sample(gc_device_t *d, const gc_taken_t *taken) {
    const gc_sample_t *sample = &taken->raw;
    if (d->stream == GC_STREAM_OFF) {
        return;
    }
    if (d->stream == GC_STREAM_TELEPLOT) {
        tell_teleplot(d, sample);
        return;
    }
    gc_sentence_t *s = gc_tell_begin_at(&d->teller, d->stream == GC_STREAM_RAW ? "RAW" : "GYR", taken->t_us);
    gc_sentence_int(s, NULL, is_recording(d) ? (int64_t)d->run->n : -1);
    if (d->stream == GC_STREAM_RAW) {
        for (size_t i = 0; i < 3u; i++) {
            gc_sentence_int(s, NULL, sample->gyro[i]);
        }
        for (size_t i = 0; i < 3u; i++) {
            gc_sentence_int(s, NULL, sample->acc[i]);
        }
        gc_sentence_int(s, NULL, sample->temp);
    } else {
        for (unsigned i = 0; i < 3u; i++) {
            gc_sentence_real(s, NULL, gc_kept_corrected(&d->kept, i, d->sampler.sensor.lsb_dps * sample->gyro[i]));
        }
    }
    gc_tell_end(&d->teller);
}

void gc_device_show(gc_device_t *d) {
    static const gc_led_t of_state[GC_STATES] = {GC_LED_IDLE, GC_LED_RECORDING, GC_LED_FLIP, GC_LED_DONE};
    gc_led_t led = of_state[d->state];
    if (led == GC_LED_DONE && !d->verdict.trusted) {
        led = GC_LED_MISFIT;
    }
    if (d->config.port->led != NULL && (!d->led_known || led != d->led)) {
        d->config.port->led(d->config.port->context, led);
    }
    d->led = led;
    d->led_known = true;
}

/* ---- runs ---- */

static bool may_store(const gc_device_t *d) {
    const gc_port_t *port = d->config.port;
    return !is_recording(d) &&
           (port->may_store == NULL || now_us(d) >= d->store_by_us || port->may_store(port->context));
}

static void store_what_changed(gc_device_t *d) {
    const gc_port_t *port = d->config.port;
    if (!(d->results_changed || d->settings_changed) || !may_store(d)) {
        return;
    }
    const int error = d->results_changed ? gc_kept_save(&d->kept, port) : GC_OK;
    const int other = d->settings_changed ? gc_settings_save(&d->settings, port) : GC_OK;
    d->results_changed = false;
    d->settings_changed = false;
    if (error != GC_OK || other != GC_OK) {
        gc_tell_error(&d->teller, error != GC_OK ? error : other);
    }
}

void gc_device_save_results(gc_device_t *d) {
    d->results_changed = true;
    d->store_by_us = now_us(d) + STORE_WITHIN_US;
    store_what_changed(d);
}

void gc_device_save_settings(gc_device_t *d) {
    d->settings_changed = true;
    d->store_by_us = now_us(d) + STORE_WITHIN_US;
    store_what_changed(d);
}

void gc_device_start(gc_device_t *d, int face, bool automatic) {
    const gc_settings_t *settings = &d->settings.now;
    const gc_sensor_t *sensor = &d->sampler.sensor;
    gc_kept_end_dump(&d->kept); /* the windows of the dump are about to be overwritten */
    if (fabs(gc_run_true_rate_dps(settings, face)) > 0.0) {
        d->run = gc_pair_begin(&d->pair, settings, sensor, face, automatic, d->sampler.samples);
    } else {
        d->run = &d->alone;
        gc_run_begin(d->run, settings, sensor, face, automatic, d->sampler.samples);
    }
    enter(d, GC_TRIGGER_START);
    gc_run_tell(d->run, &d->teller, false, d->sampler.samples);
}

static void add_to_run(gc_device_t *d, const gc_taken_t *sample) {
    bool clips;
    if (d->run != &d->alone) {
        clips = gc_pair_add(&d->pair, sample);
    } else {
        gc_run_advance(d->run, sample->t_us);
        clips = gc_run_add(d->run, sample);
    }
    if (clips) {
        gc_tell_error(&d->teller, GC_E_CLIPPED);
    }
}

static void end_alone(gc_device_t *d) {
    gc_run_end(d->run);
    gc_run_tell_faults(d->run, &d->teller);
    if (d->run->settings.turn_deg != 0.0) {
        gc_rest_end_turn(&d->rest, d->run, &d->teller, &d->kept);
    } else if (d->run->w_dps == 0.0) {
        gc_rest_end(&d->rest, d->run, &d->teller, &d->kept, &d->verdict);
    }
}

void gc_device_stop(gc_device_t *d) {
    static const gc_trigger_t by_halves[] = {GC_TRIGGER_END_NONE, GC_TRIGGER_END_HALF, GC_TRIGGER_END_PAIR};
    if (d->run == &d->alone) {
        end_alone(d);
    } else {
        gc_pair_end(&d->pair);
    }
    enter(d, by_halves[gc_pair_halves(&d->pair)]);
    gc_run_tell(d->run, &d->teller, true, d->sampler.samples);
    d->reminders = REMINDERS;
    d->reminder_us = now_us(d) + REMINDER_US;
    gc_device_save_results(d);
}

static void forget_runs(gc_device_t *d) {
    enter(d, GC_TRIGGER_FORGET);
    d->run = NULL;
    d->reminders = 0;
    gc_pair_forget(&d->pair);
    memset(&d->rest, 0, sizeof d->rest);
    d->verdict = (gc_verdict_t){.misfit = NAN};
}

void gc_device_forget(gc_device_t *d) {
    forget_runs(d);
    if (d->stream == GC_STREAM_CORRECTED) {
        d->stream = GC_STREAM_OFF;
    }
    gc_kept_forget(&d->kept);
    gc_device_save_results(d);
}

/* ---- samples ---- */

static void watch_table(gc_device_t *d, const gc_taken_t *sample) {
    const gc_watch_action_t action = gc_watch_look(&d->watch, &d->settings.now, &d->sampler.sensor, sample->t_us, &sample->raw);
    if (action == GC_WATCH_STOP && is_recording(d) && d->run->automatic) {
        gc_device_stop(d);
    }
    if (action == GC_WATCH_NOTHING || action == GC_WATCH_STOP || is_recording(d)) {
        return;
    }
    if (action == GC_WATCH_OPPOSED) {
        gc_tell_error(&d->teller, GC_E_DIRECTION);
        return;
    }
    const int face = action == GC_WATCH_START_UP ? 1 : -1;
    const double w_dps = d->settings.now.table_dps * face;
    gc_watch_disarm(&d->watch);
    gc_device_start(d, face, true);
    if (fabs(d->watch.rate_dps - w_dps) > GC_TABLE_RATE_FRACTION * fabs(w_dps)) {
        gc_tell_error(&d->teller, GC_E_TABLE_RATE);
    }
}

static void take_samples(gc_device_t *d) {
    gc_sampler_begin_reading(&d->sampler);
    do {
        const unsigned n = gc_sampler_read(&d->sampler);
        for (unsigned i = 0; i < n; i++) {
            gc_taken_t sample;
            gc_sampler_take(&d->sampler, i, &sample);
            tell_sample(d, &sample);
            if (is_recording(d)) {
                add_to_run(d, &sample);
            }
            watch_table(d, &sample);
            gc_device_show(d);
        }
    } while (gc_sampler_judge(&d->sampler));
}

void gc_device_empty_fifo(gc_device_t *d) {
    if (d->sampler.ready && d->settings.now.fifo > 0.0) {
        take_samples(d);
    }
}

/* ---- the part ---- */

const gc_part_t *gc_device_part(const gc_device_t *d, const gc_settings_t *settings) {
    const gc_part_t *part = d->config.part != NULL ? d->config.part : gc_settings_part(settings, d->config.parts);
    part = part != NULL ? part : gc_part_at(d->config.parts, d->config.address);
    return part != NULL ? part : d->config.parts[0];
}

static void name_part(gc_device_t *d) {
    const bool told = d->config.part != NULL || d->settings.now.sensor > 0;
    d->sampler.part = gc_device_part(d, &d->settings.now);
    d->sampler.parts = told ? NULL : d->config.parts;
    d->sampler.other = false;
}

/* Settings that the part does not have give way to the firmware's. The sensor stays the one that was set. */
static void fit_settings(gc_device_t *d) {
    const int32_t sensor = d->settings.now.sensor;
    if (gc_settings_check(&d->settings.now, d->sampler.part) != GC_OK) {
        gc_settings_default(&d->settings.now, d->config.calibration);
        d->settings.now.sensor = sensor;
    }
}

/* Readings of two parts go neither into one run nor into one pair. */
static void take_other_part(gc_device_t *d) {
    if (is_recording(d)) {
        gc_device_stop(d);
    }
    forget_runs(d);
    d->sampler.other = false;
    fit_settings(d);
    gc_sampler_begin_anew(&d->sampler);
}

void gc_device_begin_anew(gc_device_t *d) {
    const gc_part_t *before = d->sampler.part;
    name_part(d);
    gc_sampler_begin_anew(&d->sampler);
    if (d->sampler.other) {
        take_other_part(d);
    }
    if (d->sampler.part != before) {
        forget_runs(d);
        gc_device_hello(d);
    }
}

int gc_device_self_test(gc_device_t *d) {
    gc_self_test_t result;
    const int error = gc_sensor_self_test(&d->sampler.sensor, &result);
    if (error == GC_OK) {
        static const char *const names[] = {"x_dps", "y_dps", "z_dps"};
        gc_sentence_t *s = gc_tell_begin(&d->teller, "TST");
        gc_sentence_uint(s, "passed", result.passed ? 1u : 0u);
        for (unsigned i = 0; i < 3u; i++) {
            gc_sentence_real(s, names[i], result.change_dps[i]);
        }
        gc_sentence_real(s, "least_dps", result.least_dps);
        gc_sentence_real(s, "most_dps", result.most_dps);
        gc_tell_end(&d->teller);
    }
    gc_sampler_begin_anew(&d->sampler);
    return error;
}

/* ---- the loop ---- */

void gc_device_init(gc_device_t *d, const gc_device_config_t *config) {
    memset(d, 0, sizeof *d);
    d->config = *config;
    d->verdict.misfit = NAN;
    const int error = config->calibration != NULL ? gc_estimator_check(config->calibration) : GC_OK;
    gc_teller_init(&d->teller, config->port, config->imu);
    gc_commands_init(&d->commands);
    gc_settings_default(&d->settings.now, config->calibration);
    gc_settings_load(&d->settings, config->port, config->parts);
    gc_sampler_init(&d->sampler, &d->teller, &d->settings.now, config->part, config->address);
    name_part(d);
    if (d->sampler.parts == NULL) {
        fit_settings(d);
    }
    gc_watch_init(&d->watch);
    gc_pair_init(&d->pair, &d->teller, &d->kept, &d->verdict, error == GC_OK ? config->calibration : NULL, config->net);
    gc_kept_load(&d->kept, config->port, d->pair.net.identity);
    gc_sampler_set_up(&d->sampler);
    if (d->sampler.other) {
        take_other_part(d);
    }
    gc_device_hello(d);
    if (error != GC_OK) {
        gc_tell_error(&d->teller, error);
    }
    gc_device_show(d);
}

void gc_device_receive(gc_device_t *d, const char *data, size_t n) {
    for (size_t i = 0; i < n; i++) {
        gc_commands_hear(d, data[i]);
    }
}

void gc_device_step(gc_device_t *d) {
    gc_kept_go_on_with_dump(&d->kept, &d->teller);
    remind(d);
    store_what_changed(d);
    if (d->sampler.other) {
        take_other_part(d);
        gc_device_hello(d);
    }
    if (gc_sampler_wait(&d->sampler)) {
        const uint64_t began_us = now_us(d);
        take_samples(d);
        const uint64_t ended_us = now_us(d);
        const uint32_t took_us = ended_us > began_us ? (uint32_t)(ended_us - began_us) : 0u;
        d->slowest_us = took_us > d->slowest_us ? took_us : d->slowest_us;
    }
}
