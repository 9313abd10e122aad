#include "gc_commands.h"

#include "gc_device.h"
#include "gc_error.h"

#include <string.h>

#define WORDS_MAX 4u /* one more word than the longest command has */

typedef struct {
    gc_text_t word[WORDS_MAX];
    unsigned n;
} gc_words_t;

static bool is(const gc_words_t *words, unsigned i, const char *text) {
    return i < words->n && gc_text_equals(words->word[i], text);
}

/* Returns GC_OK, or the error with which the state refuses the trigger. */
static int allowed(const gc_device_t *d, gc_trigger_t trigger) {
    const int next = gc_state_next(d->state, trigger);
    return next < 0 ? next : GC_OK;
}

static int do_hello(gc_device_t *d, const gc_words_t *words) {
    (void)words;
    gc_tell_ack(&d->teller, "hello", NULL, NULL);
    gc_device_hello(d);
    return GC_OK;
}

static int do_status(gc_device_t *d, const gc_words_t *words) {
    (void)words;
    gc_tell_ack(&d->teller, "status", NULL, NULL);
    gc_device_status(d);
    return GC_OK;
}

static int do_start(gc_device_t *d, const gc_words_t *words) {
    const bool up = is(words, 1, "up");
    if (!up && !is(words, 1, "down")) {
        return GC_E_ARGUMENT;
    }
    gc_device_empty_fifo(d);
    const int error = allowed(d, GC_TRIGGER_START);
    if (error != GC_OK) {
        return error;
    }
    if (!d->sampler.ready) {
        return GC_E_NOT_READY;
    }
    const int face = up ? 1 : -1;
    gc_tell_ack(&d->teller, "start", "face", gc_face_name(face));
    gc_device_start(d, face, false);
    return GC_OK;
}

static int do_stop(gc_device_t *d, const gc_words_t *words) {
    (void)words;
    gc_device_empty_fifo(d);
    const int error = allowed(d, GC_TRIGGER_END_NONE);
    if (error != GC_OK) {
        return error;
    }
    gc_tell_ack(&d->teller, "stop", NULL, NULL);
    gc_watch_disarm(&d->watch);
    gc_device_stop(d);
    return GC_OK;
}

static int do_selftest(gc_device_t *d, const gc_words_t *words) {
    (void)words;
    if (d->state == GC_STATE_RECORDING) {
        return GC_E_RECORDING;
    }
    if (!d->sampler.ready) {
        return GC_E_NOT_READY;
    }
    if (d->sampler.part->self_test == NULL) {
        return GC_E_NO_SELF_TEST;
    }
    gc_tell_ack(&d->teller, "selftest", NULL, NULL);
    return gc_device_self_test(d);
}

static int do_reboot(gc_device_t *d, const gc_words_t *words) {
    (void)words;
    if (d->config.port->restart == NULL) {
        return GC_E_COMMAND;
    }
    if (d->state == GC_STATE_RECORDING) {
        return GC_E_RECORDING;
    }
    gc_tell_ack(&d->teller, "reboot", NULL, NULL);
    d->config.port->restart(d->config.port->context);
    return GC_OK;
}

static int do_stream(gc_device_t *d, const gc_words_t *words) {
    static const char *const names[] = {"off", "raw", "teleplot", "corrected"};
    for (unsigned i = 0; i < sizeof names / sizeof names[0]; i++) {
        if (is(words, 1, names[i])) {
            if (i == GC_STREAM_CORRECTED && !gc_kept_has_correction(&d->kept)) {
                return GC_E_NOT_CALIBRATED;
            }
            d->stream = (gc_stream_t)i;
            gc_tell_ack(&d->teller, "stream", "stream", names[i]);
            return GC_OK;
        }
    }
    return GC_E_ARGUMENT;
}

static int do_reset(gc_device_t *d, const gc_words_t *words) {
    (void)words;
    const int error = allowed(d, GC_TRIGGER_FORGET);
    if (error == GC_OK) {
        gc_tell_ack(&d->teller, "reset", NULL, NULL);
        gc_device_forget(d);
    }
    return error;
}

static int do_undo(gc_device_t *d, const gc_words_t *words) {
    (void)words;
    if (d->state == GC_STATE_RECORDING) {
        return GC_E_RECORDING;
    }
    const int axis = gc_kept_undo(&d->kept);
    if (axis < 0) {
        return axis;
    }
    gc_tell_ack(&d->teller, "undo", "axis", gc_axis_name(axis));
    gc_device_save_results(d);
    return GC_OK;
}

static int do_dump(gc_device_t *d, const gc_words_t *words) {
    (void)words;
    if (d->state == GC_STATE_RECORDING) {
        return GC_E_RECORDING;
    }
    gc_kept_begin_dump(&d->kept);
    gc_sentence_t *s = gc_tell_begin(&d->teller, "ACK");
    gc_sentence_text(s, "cmd", "dump");
    gc_sentence_uint(s, "lines", d->kept.dump_lines);
    gc_tell_end(&d->teller);
    return GC_OK;
}

static void tell_setting(gc_device_t *d, const char *command, gc_setting_t row) {
    gc_sentence_t *s = gc_tell_begin(&d->teller, "ACK");
    gc_sentence_text(s, "cmd", command);
    gc_settings_field(s, &d->settings.now, row, d->config.parts);
    gc_tell_end(&d->teller);
}

/* Stores a changed setting, and sets the sensor up again if the setting concerns it. */
static int change_setting(gc_device_t *d, const char *command, gc_setting_t row, gc_text_t word) {
    const gc_settings_t before = d->settings.now;
    gc_settings_t settings = before;
    int error = gc_settings_parse(&settings, row, word, d->config.parts);
    const gc_part_t *part = settings.sensor == before.sensor ? d->sampler.part : gc_device_part(d, &settings);
    if (error == GC_OK && settings.sensor != before.sensor && !gc_part_may_be_at(part, d->config.address)) {
        error = GC_E_ARGUMENT;
    }
    if (error == GC_OK) {
        error = gc_settings_check(&settings, part);
    }
    if (error != GC_OK) {
        return error;
    }
    d->settings.now = settings;
    tell_setting(d, command, row);
    gc_device_save_settings(d);
    if (settings.rate_hz != before.rate_hz || settings.full_scale_dps != before.full_scale_dps ||
        settings.fifo != before.fifo) {
        gc_sampler_begin_anew(&d->sampler);
    }
    if (settings.sensor != before.sensor) {
        gc_device_begin_anew(d);
    }
    if (row == GC_SETTING_AUTO) {
        gc_watch_arm(&d->watch);
    }
    return GC_OK;
}

static int do_auto(gc_device_t *d, const gc_words_t *words) {
    return words->n < 2u ? GC_E_ARGUMENT : change_setting(d, "auto", GC_SETTING_AUTO, words->word[1]);
}

static int do_set(gc_device_t *d, const gc_words_t *words) {
    if (d->state == GC_STATE_RECORDING) {
        return GC_E_RECORDING;
    }
    const gc_setting_t row = words->n == 3u ? gc_settings_find(words->word[1]) : GC_SETTINGS;
    return row == GC_SETTINGS ? GC_E_ARGUMENT : change_setting(d, "set", row, words->word[2]);
}

static int do_get(gc_device_t *d, const gc_words_t *words) {
    const gc_setting_t row = words->n == 2u ? gc_settings_find(words->word[1]) : GC_SETTINGS;
    if (row == GC_SETTINGS) {
        return GC_E_ARGUMENT;
    }
    tell_setting(d, "get", row);
    return GC_OK;
}

static const struct {
    const char *name;
    int (*act)(gc_device_t *d, const gc_words_t *words);
} commands[] = {
    {"hello", do_hello}, {"status", do_status}, {"start", do_start}, {"auto", do_auto}, {"stop", do_stop},
    {"stream", do_stream}, {"set", do_set}, {"get", do_get}, {"reset", do_reset}, {"dump", do_dump},
    {"undo", do_undo}, {"selftest", do_selftest}, {"reboot", do_reboot},
};

/* Returns GC_E_ARGUMENT for more words than any command has. */
static int split(const char *line, size_t n, gc_words_t *words) {
    size_t i = 0;
    words->n = 0;
    while (i < n) {
        while (i < n && (line[i] == ' ' || line[i] == '\t')) {
            i++;
        }
        const size_t from = i;
        while (i < n && line[i] != ' ' && line[i] != '\t') {
            i++;
        }
        if (i > from) {
            if (words->n == WORDS_MAX) {
                return GC_E_ARGUMENT;
            }
            words->word[words->n++] = (gc_text_t){line + from, i - from};
        }
    }
    return GC_OK;
}

static int obey(gc_device_t *d, const gc_words_t *words) {
    for (size_t k = 0; k < sizeof commands / sizeof commands[0]; k++) {
        if (is(words, 0, commands[k].name)) {
            return commands[k].act(d, words);
        }
    }
    return GC_E_COMMAND;
}

void gc_commands_init(gc_commands_t *commands_) {
    memset(commands_, 0, sizeof *commands_);
    gc_line_reader_init(&commands_->reader, commands_->line, GC_COMMAND_MAX);
}

void gc_commands_hear(gc_device_t *d, char byte) {
    gc_line_reader_t *reader = &d->commands.reader;
    const int got = gc_line_push(reader, byte);
    if (got == 0) {
        return;
    }
    gc_words_t words = {.n = 0};
    int error = got < 0 ? got : split(reader->line, reader->n, &words);
    if (error == GC_OK && words.n > 0u) {
        error = obey(d, &words);
    }
    if (error != GC_OK) {
        gc_tell_error(&d->teller, error);
    }
    gc_device_show(d);
}
