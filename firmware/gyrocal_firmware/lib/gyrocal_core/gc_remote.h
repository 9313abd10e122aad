/* A reader that comes by radio: one at a time, and only with the token.
 *
 *     gc_remote_init(&remote, queue, sizeof queue);
 *     gc_remote_set_token(&remote, token, n);
 *
 * The board accepts a connection and calls gc_remote_connect; it passes on each byte that arrives (gc_remote_hear), sends what
 * waits (gc_remote_waiting, gc_remote_took), and closes the connection when gc_remote_is_over says so. The first line of a
 * connection must be `token TOKEN`, and nothing is sent before. Sentences wait in the caller's memory. One for which there is no
 * room is refused whole, as by a wire, and the device counts it. Where several tasks call these functions, the board locks them.
 */
#ifndef GC_REMOTE_H
#define GC_REMOTE_H

#include "gc_command.h"
#include "gc_wire.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GC_TOKEN_MIN 16 /* characters of a token; each holds 6 bits if it is drawn by chance */
#define GC_TOKEN_MAX 64
#define GC_REMOTE_TOKEN_US 5000000u /* within which the token must come */
#define GC_REMOTE_STALL_US 10000000u /* a reader that has taken nothing for so long is gone */
#define GC_REMOTE_KEPT_FREE 2048u /* bytes reserved for answers to commands while samples fill the queue; a quarter of a short one */

/* What the board sends before it closes a connection that it does not take, or no longer. */
#define GC_REMOTE_BUSY_NOTE "# busy: another program has it open; close that one first\n"
#define GC_REMOTE_TOKEN_NOTE "# token: this device was not given its token\n"

typedef enum { GC_REMOTE_NONE, GC_REMOTE_STRANGER, GC_REMOTE_READER } gc_remote_state_t;

typedef struct {
    gc_remote_state_t state;
    uint64_t since_us; /* when the stranger came, or when the reader last took something or had taken all */
    uint32_t refused;  /* connections without the right token */
    char token[GC_TOKEN_MAX];
    size_t token_n; /* 0 = none was set, and nobody is taken */
    gc_line_reader_t reader;
    char line[GC_COMMAND_MAX + 1]; /* of what came; a longer one is cut, and the device refuses it */
    char *queue; /* what waits is n bytes from `first` on, round the end */
    size_t capacity, first, n;
} gc_remote_t;

void gc_remote_init(gc_remote_t *remote, char *queue, size_t capacity);
/* Whether a text may be a token: by its length, and without spaces and control characters. */
bool gc_remote_may_be_token(const char *text, size_t n);
/* Any other text means that nobody is taken. A reader that is connected stays. */
void gc_remote_set_token(gc_remote_t *remote, const char *token, size_t n);

/* Somebody has connected. Returns false if another one is there: send the note `busy` and close the connection. */
bool gc_remote_connect(gc_remote_t *remote, uint64_t now_us);
void gc_remote_disconnect(gc_remote_t *remote);
/* Takes a byte that came. Returns 1 if remote->line holds a command, of remote->reader.n bytes; 0 if not yet; GC_E_TOKEN if the first
   line was not the token: send the note `token` and close the connection. */
int gc_remote_hear(gc_remote_t *remote, char byte, uint64_t now_us);
/* Whether the connection must be closed: the token did not come in time, or the reader takes nothing any more. */
bool gc_remote_is_over(gc_remote_t *remote, uint64_t now_us);

/* Returns n, or 0 if there is no reader or no room for all n bytes. */
int gc_remote_tell(gc_remote_t *remote, const char *data, size_t n);
/* Returns how many of the waiting bytes stand in one piece at *data, `most` at most. */
size_t gc_remote_waiting(gc_remote_t *remote, size_t most, const char **data, uint64_t now_us);
/* n of them were sent. */
void gc_remote_took(gc_remote_t *remote, size_t n, uint64_t now_us);

#ifdef __cplusplus
}
#endif

#endif
