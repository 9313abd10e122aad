/* Any bytes and steps of a connection by radio: nothing waits before the token, what is taken are the accepted lines, in order and
   whole, and no more waits than there is room for. Standalone: random steps. For libFuzzer: clang -fsanitize=fuzzer -DGC_LIBFUZZER. */
#include "fuzz.h"
#include "gc_error.h"
#include "gc_remote.h"

#define ROOM 200u
#define TOKEN "m5Qb0Xw2r_K7-tYz"

static gc_remote_t remote;
static char queue[ROOM], expected[ROOM];
static size_t expected_n;
static uint64_t now_us;

static void end(void) {
    gc_remote_disconnect(&remote);
    expected_n = 0;
}

static void hear(const char *text, size_t n) {
    for (size_t i = 0; i < n; i++) {
        const gc_remote_state_t before = remote.state;
        const int got = gc_remote_hear(&remote, text[i], now_us);
        fuzz_must(got == 0 || (got == 1 && before == GC_REMOTE_READER) || (got == GC_E_TOKEN && before == GC_REMOTE_STRANGER), "heard");
        fuzz_must(got != 1 || remote.reader.n <= sizeof remote.line, "a command longer than its line");
        if (got < 0) {
            end();
        }
    }
}

static void tell(uint8_t size, uint8_t kind) {
    char line[256];
    memset(line, 'a' + kind % 26, sizeof line);
    memcpy(line, kind % 3u == 0u ? "$RAW" : "$ACK", 4);
    const int told = gc_remote_tell(&remote, line, size);
    fuzz_must(told == 0 || told == size, "a line that was taken in part");
    fuzz_must(told == 0 || remote.state == GC_REMOTE_READER, "told before the token");
    memcpy(expected + expected_n, line, (size_t)told);
    expected_n += (size_t)told;
}

static void take(uint8_t most) {
    const char *waits = NULL;
    const size_t n = gc_remote_waiting(&remote, most, &waits, now_us);
    fuzz_must(n <= most && n <= expected_n, "more than waits");
    fuzz_must(n == 0u || memcmp(waits, expected, n) == 0, "other bytes than were told");
    gc_remote_took(&remote, n, now_us);
    expected_n -= n;
    memmove(expected, expected + n, expected_n);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n) {
    gc_remote_init(&remote, queue, sizeof queue);
    gc_remote_set_token(&remote, TOKEN, sizeof TOKEN - 1u);
    now_us = 0;
    end();
    for (size_t i = 0; i + 2u < n; i += 3) {
        const uint8_t *step = data + i;
        switch (step[0] % 8u) {
        case 0:
            (void)gc_remote_connect(&remote, now_us);
            break;
        case 1:
            end();
            break;
        case 2:
            hear("token " TOKEN "\n", sizeof TOKEN + 6u);
            break;
        case 3:
            hear((const char *)step + 1, 2);
            break;
        case 4:
        case 5:
            tell(step[1], step[2]);
            break;
        case 6:
            take(step[1]);
            break;
        default:
            now_us += (uint64_t)step[1] * 50000u;
            if (gc_remote_is_over(&remote, now_us)) {
                end();
            }
        }
        fuzz_must(remote.n <= sizeof queue && remote.n == expected_n && remote.first < sizeof queue, "the queue");
    }
    return 0;
}
