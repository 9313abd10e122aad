#include "gc_device.h"

#include "gc_error.h"

#include <math.h>
#include <string.h>

#define NET_ROOM 20u /* bytes of a name in $HEL; longer names are cut */
#define REMINDERS 3u             /* after the end of a run, for a reader who missed it; chosen by judgement */
#define REMINDER_US 1000000u
#define STORE_WITHIN_US 120000000u /* of the end of a run, though others go on; chosen by judgement */

static uint64_t now_us(const gc_device_t *d) {
    return d->config.port->now_us(d->config.port->context);
}

bool gc_device_is_recording(const gc_device_t *d) {
    return d->recorder.state == GC_STATE_RECORDING;
}

/* ---- sentences ---- */

static void tell_hello(gc_device_t *d) {
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
    gc_sentence_real(s, "lsb_g", d->sampler.sensor.lsb_g);
    gc_sentence_real(s, "lsb_c", part->lsb_c);
    gc_sentence_real(s, "zero_c", part->zero_c);
    gc_sentence_real(s, "noise_dps", part->noise_dps);
    gc_settings_field(s, settings, GC_SETTING_ACCEL_G, d->config.parts);
    gc_settings_field(s, settings, GC_SETTING_LOW_PASS, d->config.parts);
    gc_settings_field(s, settings, GC_SETTING_AXIS, d->config.parts);
    gc_settings_field(s, settings, GC_SETTING_TABLE_DPS, d->config.parts);
    gc_settings_field(s, settings, GC_SETTING_TURN_DEG, d->config.parts);
    gc_sentence_text_cut(s, "cal", d->config.calibration != NULL ? d->config.calibration->name : NULL, NET_ROOM);
    gc_sentence_text_cut(s, "net", d->recorder.pair.net.name, 0);
    gc_tell_end(&d->teller);
}

static const char *waits_for(const gc_device_t *d) {
    if (!d->sampler.ready) {
        return "sensor";
    }
    if (gc_device_is_recording(d)) {
        return d->recorder.run->automatic ? "unsteady" : "stop";
    }
    if (!d->settings.now.automatic) {
        return "start";
    }
    if (!d->watch.armed) {
        return "unsteady";
    }
    return d->recorder.state == GC_STATE_FLIP ? "flip" : "steady";
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
    gc_sentence_text(s, "state", gc_state_name(d->recorder.state));
    gc_sentence_text(s, "face", gc_device_is_recording(d) ? gc_face_name(d->recorder.run->face) : NULL);
    gc_sentence_uint(s, "n", gc_device_is_recording(d) ? d->recorder.run->n : 0u);
    gc_sentence_uint(s, "lost", d->teller.lost);
    gc_sentence_uint(s, "stale", d->sampler.stale);
    gc_sentence_uint(s, "resets", d->sampler.resets);
    gc_sentence_uint(s, "missed", d->sampler.missed);
    gc_sentence_uint(s, "overruns", d->sampler.overruns);
    gc_sentence_real(s, "misfit", d->recorder.verdict.misfit);
    gc_sentence_text(s, "waits", waits_for(d));
    gc_sentence_real(s, "rate_dps", d->watch.rate_dps);
    gc_sentence_text(s, "gravity", d->watch.face != 0 ? gc_face_name(d->watch.face) : NULL);
    if (d->recorder.run != NULL) {
        gc_sentence_uint(s, "run_first", d->recorder.run->first);
        gc_sentence_uint(s, "run_n", d->recorder.run->n);
    }
    tell_load(d, s);
}

static void tell_status(gc_device_t *d) {
    begin_status(d);
    gc_tell_end(&d->teller);
}

/* A reader who missed the end of a run learns from these how many samples it had. */
static void remind(gc_device_t *d) {
    const uint64_t now = now_us(d);
    const bool is_heard = d->stream == GC_STREAM_RAW || d->stream == GC_STREAM_PACKED;
    if (d->reminders == 0u || !is_heard || gc_device_is_recording(d) || now < d->reminder_us) {
        return;
    }
    begin_status(d);
    if (gc_tell_end_or_wait(&d->teller)) {
        d->reminders--;
        d->reminder_us = now + REMINDER_US;
    }
}

static void show(gc_device_t *d) {
    static const gc_led_t of_state[GC_STATES] = {GC_LED_IDLE, GC_LED_RECORDING, GC_LED_FLIP, GC_LED_DONE};
    gc_led_t led = of_state[d->recorder.state];
    if (led == GC_LED_DONE && !d->recorder.verdict.trusted) {
        led = GC_LED_MISFIT;
    }
    if (d->config.port->led != NULL && (!d->led_known || led != d->led)) {
        d->config.port->led(d->config.port->context, led);
    }
    d->led = led;
    d->led_known = true;
}

/* ---- store ---- */

static bool may_store(const gc_device_t *d) {
    const gc_port_t *port = d->config.port;
    return !gc_device_is_recording(d) &&
           (port->may_store == NULL || now_us(d) >= d->store_by_us || port->may_store(port->context));
}

static void store_what_changed(gc_device_t *d) {
    const gc_port_t *port = d->config.port;
    if (!(d->results_changed || d->settings_changed) || !may_store(d)) {
        return;
    }
    const int error = d->results_changed ? gc_kept_save(&d->kept, port) : GC_OK;
    const int other = d->settings_changed ? gc_settings_save(&d->settings, port) : GC_OK;
    d->settings_kept = d->settings_changed ? other == GC_OK : d->settings_kept;
    d->results_changed = false;
    d->settings_changed = false;
    if (error != GC_OK || other != GC_OK) {
        gc_tell_error(&d->teller, error != GC_OK ? error : other);
    }
}

static void save_results(gc_device_t *d) {
    d->results_changed = true;
    d->store_by_us = now_us(d) + STORE_WITHIN_US;
    store_what_changed(d);
}

/* A host may set all that it needs each time that it comes; what is in flash already is not written again. */
static void save_settings(gc_device_t *d, const gc_settings_t *before) {
    if (d->settings_kept && memcmp(&d->settings.now, before, sizeof *before) == 0) {
        return;
    }
    d->settings_kept = false;
    d->settings_changed = true;
    d->store_by_us = now_us(d) + STORE_WITHIN_US;
    store_what_changed(d);
}

/* ---- runs ---- */

static void start(gc_device_t *d, int face, bool automatic) {
    gc_recorder_begin(&d->recorder, &d->settings.now, &d->sampler.sensor, face, automatic, d->sampler.samples);
}

static void stop(gc_device_t *d) {
    gc_recorder_end(&d->recorder, d->sampler.samples);
    d->reminders = REMINDERS;
    d->reminder_us = now_us(d) + REMINDER_US;
    save_results(d);
}

static void forget_runs(gc_device_t *d) {
    gc_recorder_forget(&d->recorder);
    d->reminders = 0;
}

/* ---- samples ---- */

static void watch_table(gc_device_t *d, const gc_taken_t *sample) {
    const gc_watch_action_t action = gc_watch_look(&d->watch, &d->settings.now, &d->sampler.sensor, sample->t_us, &sample->raw);
    if (action == GC_WATCH_STOP && gc_device_is_recording(d) && d->recorder.run->automatic) {
        stop(d);
    }
    if (action == GC_WATCH_NOTHING || action == GC_WATCH_STOP || gc_device_is_recording(d)) {
        return;
    }
    if (action == GC_WATCH_OPPOSED) {
        gc_tell_error(&d->teller, GC_E_DIRECTION);
        return;
    }
    const int face = action == GC_WATCH_START_UP ? 1 : -1;
    const double w_dps = d->settings.now.table_dps * face;
    gc_watch_disarm(&d->watch);
    start(d, face, true);
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
            const int64_t number = gc_device_is_recording(d) ? (int64_t)d->recorder.run->n : -1;
            gc_stream_tell(d->stream, &d->teller, &d->sampler.sensor, &d->kept, number, &sample);
            if (gc_device_is_recording(d)) {
                gc_recorder_add(&d->recorder, &sample);
            }
            watch_table(d, &sample);
            show(d);
        }
    } while (gc_sampler_judge(&d->sampler));
    gc_tell_packed(&d->teller);
}

/* Takes the samples that the FIFO still holds, so that they come before a change. */
static void empty_fifo(gc_device_t *d) {
    if (d->sampler.ready && d->settings.now.fifo > 0.0) {
        take_samples(d);
    }
}

/* ---- the part ---- */

/* The part that these settings name, or that is asked first for its id. */
static const gc_part_t *part_of(const gc_device_t *d, const gc_settings_t *settings) {
    const gc_part_t *part = d->config.part != NULL ? d->config.part : gc_settings_part(settings, d->config.parts);
    part = part != NULL ? part : gc_part_at(d->config.parts, d->config.port, d->config.address);
    return part != NULL ? part : d->config.parts[0];
}

static void name_part(gc_device_t *d) {
    const bool told = d->config.part != NULL || d->settings.now.sensor > 0;
    d->sampler.part = part_of(d, &d->settings.now);
    d->sampler.parts = told ? NULL : d->config.parts;
    d->sampler.other = false;
}

/* Settings that the part does not have give way to the firmware's. The sensor stays the one that was set. */
static void fit_settings(gc_device_t *d) {
    const int32_t sensor = d->settings.now.sensor;
    if (gc_settings_check(&d->settings.now, d->sampler.part, d->config.port) != GC_OK) {
        gc_settings_default(&d->settings.now, d->config.calibration);
        d->settings.now.sensor = sensor;
        d->settings_kept = false;
    }
}

/* Readings of two parts go neither into one run nor into one pair. */
static void take_other_part(gc_device_t *d) {
    if (gc_device_is_recording(d)) {
        stop(d);
    }
    forget_runs(d);
    d->sampler.other = false;
    fit_settings(d);
    gc_sampler_begin_anew(&d->sampler);
}

/* After a change of settings: sets the sensor up, as another part if `sensor` has changed. */
static void begin_anew(gc_device_t *d) {
    const gc_part_t *before = d->sampler.part;
    name_part(d);
    gc_sampler_begin_anew(&d->sampler);
    if (d->sampler.other) {
        take_other_part(d);
    }
    if (d->sampler.part != before) {
        forget_runs(d);
        tell_hello(d);
    }
}

/* ---- commands ---- */

static void acknowledge(gc_device_t *d, const gc_command_t *command, const char *name, const char *value) {
    gc_tell_ack(&d->teller, gc_command_name(command->kind), name, value);
}

static int do_hello(gc_device_t *d, const gc_command_t *command) {
    acknowledge(d, command, NULL, NULL);
    tell_hello(d);
    return GC_OK;
}

static int do_status(gc_device_t *d, const gc_command_t *command) {
    acknowledge(d, command, NULL, NULL);
    tell_status(d);
    return GC_OK;
}

static int do_start(gc_device_t *d, const gc_command_t *command) {
    empty_fifo(d);
    const int error = gc_recorder_allows(&d->recorder, GC_TRIGGER_START);
    if (error != GC_OK) {
        return error;
    }
    if (!d->sampler.ready) {
        return GC_E_NOT_READY;
    }
    acknowledge(d, command, "face", gc_face_name(command->face));
    start(d, command->face, false);
    return GC_OK;
}

static int do_stop(gc_device_t *d, const gc_command_t *command) {
    empty_fifo(d);
    const int error = gc_recorder_allows(&d->recorder, GC_TRIGGER_END_NONE);
    if (error != GC_OK) {
        return error;
    }
    acknowledge(d, command, NULL, NULL);
    gc_watch_disarm(&d->watch);
    stop(d);
    return GC_OK;
}

static int do_stream(gc_device_t *d, const gc_command_t *command) {
    if (command->stream == GC_STREAM_CORRECTED && !gc_kept_has_correction(&d->kept)) {
        return GC_E_NOT_CALIBRATED;
    }
    if (!gc_stream_fits(command->stream, d->settings.now.rate_hz)) {
        return GC_E_STREAM_RATE;
    }
    d->stream = command->stream;
    acknowledge(d, command, "stream", gc_stream_name(d->stream));
    return GC_OK;
}

static void tell_setting(gc_device_t *d, const gc_command_t *command) {
    gc_sentence_t *s = gc_tell_begin(&d->teller, "ACK");
    gc_sentence_text(s, "cmd", gc_command_name(command->kind));
    gc_settings_field(s, &d->settings.now, command->setting, d->config.parts);
    gc_tell_end(&d->teller);
}

static int do_get(gc_device_t *d, const gc_command_t *command) {
    tell_setting(d, command);
    return GC_OK;
}

/* Stores a changed setting, and sets the sensor up again if the setting concerns it. */
static int do_set(gc_device_t *d, const gc_command_t *command) {
    const gc_settings_t before = d->settings.now;
    gc_settings_t settings = before;
    int error = gc_settings_parse(&settings, command->setting, command->value, d->config.parts);
    const gc_part_t *part = settings.sensor == before.sensor ? d->sampler.part : part_of(d, &settings);
    if (error == GC_OK && settings.sensor != before.sensor && !gc_part_may_be_at(part, d->config.port, d->config.address)) {
        error = d->config.port->spi != NULL ? GC_E_NO_SPI : GC_E_ARGUMENT;
    }
    if (error == GC_OK) {
        error = gc_settings_check(&settings, part, d->config.port);
    }
    if (error == GC_OK && !gc_stream_fits(d->stream, settings.rate_hz)) {
        error = GC_E_STREAM_RATE;
    }
    if (error != GC_OK) {
        return error;
    }
    d->settings.now = settings;
    tell_setting(d, command);
    save_settings(d, &before);
    if (settings.rate_hz != before.rate_hz || settings.full_scale_dps != before.full_scale_dps ||
        settings.fifo != before.fifo || settings.accel_g != before.accel_g || settings.low_pass != before.low_pass) {
        gc_sampler_begin_anew(&d->sampler);
    }
    if (settings.sensor != before.sensor) {
        begin_anew(d);
    }
    if (command->setting == GC_SETTING_AUTO) {
        gc_watch_arm(&d->watch);
    }
    return GC_OK;
}

static int do_reset(gc_device_t *d, const gc_command_t *command) {
    const int error = gc_recorder_allows(&d->recorder, GC_TRIGGER_FORGET);
    if (error != GC_OK) {
        return error;
    }
    acknowledge(d, command, NULL, NULL);
    forget_runs(d);
    if (d->stream == GC_STREAM_CORRECTED) {
        d->stream = GC_STREAM_OFF;
    }
    gc_kept_forget(&d->kept);
    save_results(d);
    return GC_OK;
}

static int do_dump(gc_device_t *d, const gc_command_t *command) {
    gc_kept_begin_dump(&d->kept);
    gc_sentence_t *s = gc_tell_begin(&d->teller, "ACK");
    gc_sentence_text(s, "cmd", gc_command_name(command->kind));
    gc_sentence_uint(s, "lines", d->kept.dump_lines);
    gc_tell_end(&d->teller);
    return GC_OK;
}

static int do_undo(gc_device_t *d, const gc_command_t *command) {
    const int axis = gc_kept_undo(&d->kept);
    if (axis < 0) {
        return axis;
    }
    acknowledge(d, command, "axis", gc_axis_name(axis));
    save_results(d);
    return GC_OK;
}

static int do_selftest(gc_device_t *d, const gc_command_t *command) {
    if (!d->sampler.ready) {
        return GC_E_NOT_READY;
    }
    if (d->sampler.part->self_test == NULL) {
        return GC_E_NO_SELF_TEST;
    }
    acknowledge(d, command, NULL, NULL);
    gc_self_test_t result;
    const int error = gc_sensor_self_test(&d->sampler.sensor, &result);
    if (error == GC_OK) {
        gc_tell_self_test(&d->teller, &result);
    }
    gc_sampler_begin_anew(&d->sampler);
    return error;
}

static int do_reboot(gc_device_t *d, const gc_command_t *command) {
    if (d->config.port->restart == NULL) {
        return GC_E_COMMAND;
    }
    if (gc_device_is_recording(d)) {
        return GC_E_RECORDING;
    }
    acknowledge(d, command, NULL, NULL);
    d->config.port->restart(d->config.port->context);
    return GC_OK;
}

static void tell_wifi(gc_device_t *d) {
    const gc_port_t *port = d->config.port;
    gc_wifi_state_t state = {.state = "off"};
    port->wifi_state(port->context, &state);
    gc_sentence_t *s = gc_tell_begin(&d->teller, "NET");
    gc_sentence_text(s, "state", state.state);
    gc_sentence_text(s, "host", state.host);
    gc_sentence_text(s, "address", state.address);
    gc_sentence_uint(s, "port", state.port);
    gc_sentence_uint(s, "reader", state.reader ? 1u : 0u);
    gc_sentence_uint(s, "refused", state.refused);
    gc_tell_end(&d->teller);
}

/* What was given is not sent back. */
static int do_wifi(gc_device_t *d, const gc_command_t *command) {
    const gc_port_t *port = d->config.port;
    if (port->wifi == NULL) {
        return GC_E_COMMAND;
    }
    const int error =
        command->wifi == GC_WIFI_STATE ? GC_OK : port->wifi(port->context, command->wifi, command->value.text, command->value.n);
    if (error != GC_OK) {
        return error;
    }
    acknowledge(d, command, NULL, NULL);
    if (command->wifi == GC_WIFI_STATE) {
        tell_wifi(d);
    }
    return GC_OK;
}

static const struct {
    int (*act)(gc_device_t *d, const gc_command_t *command);
    bool between_runs; /* refused while a run goes on */
} commands[GC_COMMANDS] = {
    [GC_COMMAND_HELLO] = {do_hello, false},
    [GC_COMMAND_STATUS] = {do_status, false},
    [GC_COMMAND_START] = {do_start, false},
    [GC_COMMAND_AUTO] = {do_set, false},
    [GC_COMMAND_STOP] = {do_stop, false},
    [GC_COMMAND_STREAM] = {do_stream, false},
    [GC_COMMAND_SET] = {do_set, true},
    [GC_COMMAND_GET] = {do_get, false},
    [GC_COMMAND_RESET] = {do_reset, false},
    [GC_COMMAND_DUMP] = {do_dump, true},
    [GC_COMMAND_UNDO] = {do_undo, true},
    [GC_COMMAND_SELFTEST] = {do_selftest, true},
    [GC_COMMAND_REBOOT] = {do_reboot, false},
    [GC_COMMAND_WIFI] = {do_wifi, true},
};

static int obey(gc_device_t *d, const gc_command_t *command) {
    if (commands[command->kind].between_runs && gc_device_is_recording(d)) {
        return GC_E_RECORDING;
    }
    if (command->error != GC_OK || command->kind == GC_COMMAND_NONE) {
        return command->error;
    }
    return commands[command->kind].act(d, command);
}

static void hear(gc_device_t *d, char byte) {
    const int got = gc_line_push(&d->reader, byte);
    if (got == 0) {
        return;
    }
    int error = got;
    if (got > 0) {
        const gc_command_t command = gc_command_read(d->reader.line, d->reader.n);
        error = obey(d, &command);
    }
    if (error != GC_OK) {
        gc_tell_error(&d->teller, error);
    }
    show(d);
}

/* ---- the loop ---- */

void gc_device_init(gc_device_t *d, const gc_device_config_t *config) {
    memset(d, 0, sizeof *d);
    d->config = *config;
    const int error = config->calibration != NULL ? gc_estimator_check(config->calibration) : GC_OK;
    gc_teller_init(&d->teller, config->port, config->imu);
    gc_line_reader_init(&d->reader, d->line, sizeof d->line);
    gc_settings_default(&d->settings.now, config->calibration);
    gc_settings_load(&d->settings, config->port, config->parts);
    d->settings_kept = d->settings.record.sequence != 0u;
    gc_sampler_init(&d->sampler, &d->teller, &d->settings.now, config->part, config->address);
    name_part(d);
    if (d->sampler.parts == NULL) {
        fit_settings(d);
    }
    gc_watch_init(&d->watch);
    gc_recorder_init(&d->recorder, &d->teller, &d->kept, error == GC_OK ? config->calibration : NULL, config->net);
    gc_kept_load(&d->kept, config->port, d->recorder.pair.net.identity);
    gc_sampler_set_up(&d->sampler);
    if (d->sampler.other) {
        take_other_part(d);
    }
    tell_hello(d);
    if (error != GC_OK) {
        gc_tell_error(&d->teller, error);
    }
    show(d);
}

void gc_device_receive(gc_device_t *d, const char *data, size_t n) {
    for (size_t i = 0; i < n; i++) {
        hear(d, data[i]);
    }
}

void gc_device_step(gc_device_t *d) {
    gc_kept_go_on_with_dump(&d->kept, &d->teller);
    remind(d);
    store_what_changed(d);
    if (d->sampler.other) {
        take_other_part(d);
        tell_hello(d);
    }
    if (gc_sampler_wait(&d->sampler)) {
        const uint64_t began_us = now_us(d);
        take_samples(d);
        const uint64_t ended_us = now_us(d);
        const uint32_t took_us = ended_us > began_us ? (uint32_t)(ended_us - began_us) : 0u;
        d->slowest_us = took_us > d->slowest_us ? took_us : d->slowest_us;
    }
}
