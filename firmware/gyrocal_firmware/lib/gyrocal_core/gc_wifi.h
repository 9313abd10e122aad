/* How a board joins a wireless network: the words of the command `wifi`, and what is kept of them over power-off. */
#ifndef GC_WIFI_H
#define GC_WIFI_H

#include "gc_remote.h"
#include "gc_store.h"
#include "gc_wire.h"

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GC_WIFI_NAME_MAX 32 /* characters, by IEEE 802.11 */
#define GC_WIFI_PASSWORD_MIN 8 /* of WPA2; none for an open network */
#define GC_WIFI_PASSWORD_MAX 63
#define GC_WIFI_PORT 4242 /* of TCP */

typedef struct {
    gc_record_t record;
    char name[GC_WIFI_NAME_MAX + 1]; /* of the network; each text ends with NUL, and is empty if it was not given */
    char password[GC_WIFI_PASSWORD_MAX + 1];
    char token[GC_TOKEN_MAX + 1];
    uint32_t on; /* 0 or 1 */
} gc_wifi_t;

/* Returns the word, or GC_WIFI_WORDS for an unknown one. */
gc_wifi_word_t gc_wifi_find(gc_text_t word);
/* Changes what is kept. Returns GC_OK, GC_E_ARGUMENT for a text that the word cannot have, or GC_E_NO_NETWORK where it is to be
   switched on without a name and a token. */
int gc_wifi_set(gc_wifi_t *wifi, gc_wifi_word_t word, gc_text_t text);

/* Off and empty if nothing is kept. */
void gc_wifi_load(gc_wifi_t *wifi, const gc_port_t *port);
/* Writes both slots, so that no password of before stays in one. Returns GC_E_STORE if it failed. */
int gc_wifi_save(gc_wifi_t *wifi, const gc_port_t *port);

#ifdef __cplusplus
}
#endif

#endif
