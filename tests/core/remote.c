/* A remote reader and the words of `wifi`, by lines of standard input. Times are in microseconds.
 *
 *     room BYTES [TOKEN]    anew, with so much room; without a token nobody is taken
 *     at US                 the time from now on
 *     connect|disconnect    connect: 1 if taken
 *     hear TEXT             and a newline, byte by byte: the commands that they make, `wrong_token` and nothing more if refused
 *     cut TEXT              the same without the newline
 *     tell TEXT             and a newline: what the function returns
 *     take MOST             takes a piece: `=` and the bytes, newlines as /
 *     over                  1 if the connection must be closed
 *     state                 none, stranger or reader; refused; bytes that wait
 *     wifi WORD [TEXT]      the name of the error, on or off, and whether each text is kept
 *     power WORD            save: writes it to the store; load: reads it; cut: a write that fails half-way
 */
#include "gc_error.h"
#include "gc_remote.h"
#include "gc_wifi.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static struct {
    char key[16];
    unsigned char data[512];
    size_t n;
} slots[2];
static bool is_cut;

static int store(void *context, const char *key, const void *data, size_t n) {
    (void)context;
    const unsigned i = key[strlen(key) - 1u] == 'a' ? 0u : 1u;
    snprintf(slots[i].key, sizeof slots[i].key, "%s", key);
    memcpy(slots[i].data, data, is_cut ? n / 2u : n);
    slots[i].n = n;
    return is_cut ? -1 : 0;
}

static int load(void *context, const char *key, void *data, size_t n) {
    (void)context;
    for (unsigned i = 0; i < 2u; i++) {
        if (strcmp(slots[i].key, key) == 0 && slots[i].n == n) {
            memcpy(data, slots[i].data, n);
            return (int)n;
        }
    }
    return -1;
}

static gc_remote_t remote;
static gc_wifi_t wifi;
static char *queue;
static uint64_t now_us;

static void begin(char *words) {
    char *token = strchr(words, ' ');
    const size_t room = (size_t)strtoul(words, NULL, 10);
    free(queue);
    queue = malloc(room);
    gc_remote_init(&remote, queue, room);
    gc_remote_set_token(&remote, token != NULL ? token + 1 : "", token != NULL ? strlen(token + 1) : 0u);
}

static void hear(const char *text, size_t n) {
    for (size_t i = 0; i < n; i++) {
        const int got = gc_remote_hear(&remote, text[i], now_us);
        if (got < 0) {
            puts(gc_error_name(got));
            return;
        }
        if (got > 0) {
            printf("command %.*s\n", (int)remote.reader.n, remote.line);
        }
    }
}

static void take(size_t most) {
    const char *data = NULL;
    const size_t n = gc_remote_waiting(&remote, most, &data, now_us);
    putchar('=');
    for (size_t i = 0; i < n; i++) {
        putchar(data[i] == '\n' ? '/' : data[i]);
    }
    putchar('\n');
    gc_remote_took(&remote, n, now_us);
}

static void set_wifi(char *words) {
    char *text = strchr(words, ' ');
    const gc_text_t word = {words, text != NULL ? (size_t)(text - words) : strlen(words)};
    const gc_text_t value = {text != NULL ? text + 1 : "", text != NULL ? strlen(text + 1) : 0u};
    const int error = gc_wifi_set(&wifi, gc_wifi_find(word), value);
    printf("%s %s", gc_error_name(error), wifi.on != 0u ? "on" : "off");
    printf(" %d%d%d\n", wifi.name[0] != '\0', wifi.password[0] != '\0', wifi.token[0] != '\0');
}

static void power(const char *word) {
    const gc_port_t port = {.store = store, .load = load};
    is_cut = strcmp(word, "cut") == 0;
    if (strcmp(word, "load") == 0) {
        gc_wifi_load(&wifi, &port);
        printf("%s [%s] [%s] [%s]\n", wifi.on != 0u ? "on" : "off", wifi.name, wifi.password, wifi.token);
    } else {
        puts(gc_error_name(gc_wifi_save(&wifi, &port)));
    }
}

static void obey(char *line) {
    static const char *const states[] = {"none", "stranger", "reader"};
    char *rest = strchr(line, ' ');
    rest = rest != NULL ? rest : line + strlen(line);
    if (*rest != '\0') {
        *rest++ = '\0';
    }
    const size_t n = strlen(rest);
    if (strcmp(line, "room") == 0) {
        begin(rest);
    } else if (strcmp(line, "at") == 0) {
        now_us = strtoull(rest, NULL, 10);
    } else if (strcmp(line, "connect") == 0) {
        printf("%d\n", gc_remote_connect(&remote, now_us));
    } else if (strcmp(line, "disconnect") == 0) {
        gc_remote_disconnect(&remote);
    } else if (strcmp(line, "hear") == 0 || strcmp(line, "cut") == 0) {
        rest[n] = '\n';
        hear(rest, line[0] == 'h' ? n + 1u : n);
    } else if (strcmp(line, "tell") == 0) {
        rest[n] = '\n';
        printf("%d\n", gc_remote_tell(&remote, rest, n + 1u));
    } else if (strcmp(line, "take") == 0) {
        take((size_t)strtoul(rest, NULL, 10));
    } else if (strcmp(line, "over") == 0) {
        printf("%d\n", gc_remote_is_over(&remote, now_us));
    } else if (strcmp(line, "state") == 0) {
        printf("%s %" PRIu32 " %zu\n", states[remote.state], remote.refused, remote.n);
    } else if (strcmp(line, "wifi") == 0) {
        set_wifi(rest);
    } else if (strcmp(line, "power") == 0) {
        power(rest);
    }
}

int main(void) {
    static char line[4096];
    while (fgets(line, sizeof line - 1u, stdin) != NULL) {
        line[strcspn(line, "\n")] = '\0';
        obey(line);
    }
    free(queue);
    return 0;
}
