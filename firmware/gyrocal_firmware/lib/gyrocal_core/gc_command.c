#include "gc_command.h"

#include "gc_error.h"
#include "gc_wifi.h"

#define WORDS_MAX 4u /* one more word than the longest command has */

typedef struct {
    gc_text_t word[WORDS_MAX];
    unsigned n;
    bool too_many; /* for any command but `wifi` */
    const char *end; /* of the line */
} gc_words_t;

static bool is(const gc_words_t *words, unsigned i, const char *text) {
    return i < words->n && gc_text_equals(words->word[i], text);
}

/* The functions that read the words after the first return GC_OK or GC_E_ARGUMENT. */

static int read_face(const gc_words_t *words, gc_command_t *command) {
    command->face = is(words, 1, "up") ? 1 : -1;
    return command->face > 0 || is(words, 1, "down") ? GC_OK : GC_E_ARGUMENT;
}

static int read_stream(const gc_words_t *words, gc_command_t *command) {
    command->stream = words->n > 1u ? gc_stream_find(words->word[1]) : GC_STREAMS;
    return command->stream < GC_STREAMS ? GC_OK : GC_E_ARGUMENT;
}

static int read_switch(const gc_words_t *words, gc_command_t *command) {
    if (words->n < 2u) {
        return GC_E_ARGUMENT;
    }
    command->setting = GC_SETTING_AUTO;
    command->value = words->word[1];
    return GC_OK;
}

static int read_name(const gc_words_t *words, gc_command_t *command) {
    command->setting = words->n == 2u ? gc_settings_find(words->word[1]) : GC_SETTINGS;
    return command->setting < GC_SETTINGS ? GC_OK : GC_E_ARGUMENT;
}

static int read_name_and_value(const gc_words_t *words, gc_command_t *command) {
    if (words->n != 3u) {
        return GC_E_ARGUMENT;
    }
    command->setting = gc_settings_find(words->word[1]);
    command->value = words->word[2];
    return command->setting < GC_SETTINGS ? GC_OK : GC_E_ARGUMENT;
}

/* What follows the second word and one space is the text, whatever is in it. */
static int read_wifi(const gc_words_t *words, gc_command_t *command) {
    const gc_text_t none = {words->end, 0};
    command->wifi = gc_wifi_find(words->n > 1u ? words->word[1] : none);
    command->value = none;
    if (words->n > 2u) {
        command->value.text = words->word[1].text + words->word[1].n + 1u;
        command->value.n = (size_t)(words->end - command->value.text);
    }
    return command->wifi < GC_WIFI_WORDS ? GC_OK : GC_E_ARGUMENT;
}

static const struct {
    const char *name;
    int (*read)(const gc_words_t *words, gc_command_t *command); /* NULL = words after the first do not matter */
} table[GC_COMMANDS] = {
    [GC_COMMAND_HELLO] = {"hello", NULL},
    [GC_COMMAND_STATUS] = {"status", NULL},
    [GC_COMMAND_START] = {"start", read_face},
    [GC_COMMAND_AUTO] = {"auto", read_switch},
    [GC_COMMAND_STOP] = {"stop", NULL},
    [GC_COMMAND_STREAM] = {"stream", read_stream},
    [GC_COMMAND_SET] = {"set", read_name_and_value},
    [GC_COMMAND_GET] = {"get", read_name},
    [GC_COMMAND_RESET] = {"reset", NULL},
    [GC_COMMAND_DUMP] = {"dump", NULL},
    [GC_COMMAND_UNDO] = {"undo", NULL},
    [GC_COMMAND_SELFTEST] = {"selftest", NULL},
    [GC_COMMAND_REBOOT] = {"reboot", NULL},
    [GC_COMMAND_WIFI] = {"wifi", read_wifi},
};

static void split(const char *line, size_t n, gc_words_t *words) {
    size_t i = 0;
    words->n = 0;
    words->too_many = false;
    words->end = line + n;
    while (i < n && !words->too_many) {
        while (i < n && (line[i] == ' ' || line[i] == '\t')) {
            i++;
        }
        const size_t from = i;
        while (i < n && line[i] != ' ' && line[i] != '\t') {
            i++;
        }
        if (i > from) {
            words->too_many = words->n == WORDS_MAX;
            if (!words->too_many) {
                words->word[words->n++] = (gc_text_t){line + from, i - from};
            }
        }
    }
}

gc_command_t gc_command_read(const char *line, size_t n) {
    gc_words_t words;
    gc_command_t command = {.kind = GC_COMMAND_NONE};
    split(line, n, &words);
    if (words.too_many && !is(&words, 0, table[GC_COMMAND_WIFI].name)) {
        command.error = GC_E_ARGUMENT;
        return command;
    }
    if (words.n == 0u) {
        return command;
    }
    unsigned kind = GC_COMMAND_NONE + 1u;
    while (kind < GC_COMMANDS && !is(&words, 0, table[kind].name)) {
        kind++;
    }
    if (kind == GC_COMMANDS) {
        command.error = GC_E_COMMAND;
        return command;
    }
    command.kind = (gc_command_kind_t)kind;
    command.error = table[kind].read != NULL ? table[kind].read(&words, &command) : GC_OK;
    return command;
}

const char *gc_command_name(gc_command_kind_t kind) {
    return table[kind].name;
}
