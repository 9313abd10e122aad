#include "gc_wifi.h"

#include "gc_error.h"

#include <string.h>

#define KEY "wifi"
#define VERSION 1u /* version of the layout of gc_wifi_t */

static const char *const words[GC_WIFI_WORDS] = {
    [GC_WIFI_STATE] = "",       [GC_WIFI_NAME] = "name", [GC_WIFI_PASSWORD] = "password", [GC_WIFI_TOKEN] = "token",
    [GC_WIFI_ON] = "on",        [GC_WIFI_OFF] = "off",   [GC_WIFI_FORGET] = "forget",
};

gc_wifi_word_t gc_wifi_find(gc_text_t word) {
    unsigned i = 0;
    while (i < GC_WIFI_WORDS && !gc_text_equals(word, words[i])) {
        i++;
    }
    return (gc_wifi_word_t)i;
}

static int keep(char *kept, size_t least, size_t most, gc_text_t text) {
    if (text.n < least || text.n > most) {
        return GC_E_ARGUMENT;
    }
    memset(kept, 0, most + 1u);
    memcpy(kept, text.text, text.n);
    return GC_OK;
}

int gc_wifi_set(gc_wifi_t *wifi, gc_wifi_word_t word, gc_text_t text) {
    switch (word) {
    case GC_WIFI_NAME:
        return keep(wifi->name, 1, GC_WIFI_NAME_MAX, text);
    case GC_WIFI_PASSWORD:
        return keep(wifi->password, text.n == 0u ? 0 : GC_WIFI_PASSWORD_MIN, GC_WIFI_PASSWORD_MAX, text);
    case GC_WIFI_TOKEN:
        return gc_remote_may_be_token(text.text, text.n) ? keep(wifi->token, GC_TOKEN_MIN, GC_TOKEN_MAX, text) : GC_E_ARGUMENT;
    case GC_WIFI_ON:
        wifi->on = wifi->name[0] != '\0' && wifi->token[0] != '\0' ? 1u : 0u;
        return wifi->on != 0u ? GC_OK : GC_E_NO_NETWORK;
    case GC_WIFI_OFF:
        wifi->on = 0;
        return GC_OK;
    case GC_WIFI_FORGET:
        memset(wifi->name, 0, sizeof *wifi - offsetof(gc_wifi_t, name));
        return GC_OK;
    default:
        return GC_E_ARGUMENT;
    }
}

void gc_wifi_load(gc_wifi_t *wifi, const gc_port_t *port) {
    (void)gc_store_load(port, KEY, VERSION, &wifi->record, sizeof *wifi);
}

int gc_wifi_save(gc_wifi_t *wifi, const gc_port_t *port) {
    const int error = gc_store_save(port, KEY, VERSION, &wifi->record, sizeof *wifi);
    return error != GC_OK ? error : gc_store_save(port, KEY, VERSION, &wifi->record, sizeof *wifi);
}
