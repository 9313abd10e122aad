/* One $RAW sentence. */
#include "cost.h"

#include "gc_wire.h"

const unsigned cost_times = 1000;

void cost_prepare(void) {
}

void cost_act(void) {
    static gc_sentence_t s;
    static uint32_t seq;
    gc_sentence_begin(&s, "RAW", 100000u + seq, 25000488u + 6897u * (uint64_t)seq, 0);
    gc_sentence_int(&s, 0, (int64_t)(seq % 10000u));
    for (int i = 0; i < 7; i++) {
        gc_sentence_int(&s, 0, (i & 1 ? -1 : 1) * (i == 2 ? 8957 : 40 * i + 3));
    }
    gc_sentence_end(&s);
    seq++;
}
