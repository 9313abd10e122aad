#include "gc_pack.h"

#include "gc_wire.h"

#include <string.h>

#define KIND 1u
#define HEAD 27u
#define A_SAMPLE 8u
#define LONGEST_BLOCK 254u /* of COBS: bytes that are not 0 */

/* The lowest byte first. */
static void put(uint8_t *at, uint64_t value, size_t n) {
    for (size_t i = 0; i < n; i++) {
        at[i] = (uint8_t)(value >> (8u * i) & 0xFFu);
    }
}

static void put_words(uint8_t *at, const int16_t words[3]) {
    for (size_t i = 0; i < 3u; i++) {
        put(at + 2u * i, (uint16_t)words[i], 2);
    }
}

bool gc_pack_takes(const gc_pack_t *pack, int64_t number, uint64_t t_us, const gc_sample_t *sample) {
    const int64_t next = pack->number < 0 ? -1 : pack->number + 1;
    const bool alike = memcmp(sample->acc, pack->newest.acc, sizeof sample->acc) == 0 && sample->temp == pack->newest.temp;
    return pack->samples == 0u || (pack->samples < GC_PACK_MAX && number == next && t_us - pack->t_us <= 0xFFFFu && alike);
}

void gc_pack_add(gc_pack_t *pack, unsigned imu, uint32_t seq, int64_t number, uint64_t t_us, const gc_sample_t *sample) {
    uint8_t *at = pack->bytes + HEAD + A_SAMPLE * pack->samples;
    if (pack->samples == 0u) {
        pack->bytes[0] = KIND;
        pack->bytes[1] = (uint8_t)imu;
        put(pack->bytes + 3, seq, 4);
        put(pack->bytes + 7, t_us, 8);
        put(pack->bytes + 15, (uint64_t)number, 4);
        put_words(pack->bytes + 19, sample->acc);
        put(pack->bytes + 25, (uint16_t)sample->temp, 2);
        pack->t_us = t_us;
    }
    put(at, t_us - pack->t_us, 2);
    put_words(at + 2, sample->gyro);
    pack->samples++;
    pack->bytes[2] = (uint8_t)pack->samples;
    pack->number = number;
    pack->t_us = t_us;
    pack->newest = *sample;
}

/* Consistent overhead byte stuffing: blocks without a 0, each behind the distance to the 0 that follows it. */
static size_t stuff(const uint8_t *bytes, size_t n, char *out) {
    size_t mark = 0, at = 1;
    uint8_t distance = 1;
    for (size_t i = 0; i < n; i++) {
        if (bytes[i] != 0u) {
            out[at++] = (char)bytes[i];
            distance++;
        }
        if (bytes[i] == 0u || (distance > LONGEST_BLOCK && i + 1u < n)) {
            out[mark] = (char)distance;
            mark = at++;
            distance = 1;
        }
    }
    out[mark] = (char)distance;
    return at;
}

size_t gc_pack_end(gc_pack_t *pack, char *frame) {
    const size_t n = HEAD + A_SAMPLE * pack->samples;
    put(pack->bytes + n, gc_wire_crc((const char *)pack->bytes, n), 2);
    frame[0] = '\0';
    const size_t stuffed = stuff(pack->bytes, n + 2u, frame + 1);
    frame[1u + stuffed] = '\0';
    pack->samples = 0;
    return stuffed + 2u;
}
