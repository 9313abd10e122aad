/* gc_store on a medium that may lose power after any byte. Prints `ok` and the bytes of a record, or what went wrong. */
#include "gc_error.h"
#include "gc_store.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define VERSION 7u
#define DATA 40
#define SLOT_MAX 128

typedef struct {
    gc_record_t record;
    unsigned char data[DATA];
} kept_t;

typedef struct {
    unsigned char slot[2][SLOT_MAX];
    size_t n[2];
    long power; /* bytes until it fails; negative: it lasts */
    int refuses;
} medium_t;

static int slot_of(const char *key) {
    if (strncmp(key, "kept", 4) != 0 || (key[4] != 'a' && key[4] != 'b') || key[5] != '\0') {
        printf("key %s\n", key);
        exit(1);
    }
    return key[4] - 'a';
}

/* A byte at a time; the old length holds until the last. */
static int store(void *context, const char *key, const void *data, size_t n) {
    medium_t *m = context;
    const int s = slot_of(key);
    if (m->refuses) {
        return -1;
    }
    for (size_t i = 0; i < n; i++) {
        if (m->power == 0) {
            return 0; /* nobody is there to be told */
        }
        m->power--;
        m->slot[s][i] = ((const unsigned char *)data)[i];
        m->n[s] = m->n[s] > i + 1 ? m->n[s] : i + 1;
    }
    return 0;
}

static int load(void *context, const char *key, void *data, size_t n) {
    const medium_t *m = context;
    const int s = slot_of(key);
    if (m->n[s] == 0 || m->n[s] > n) {
        return -1;
    }
    memcpy(data, m->slot[s], m->n[s]);
    return (int)m->n[s];
}

static gc_port_t port_of(medium_t *m) {
    const gc_port_t port = {.context = m, .store = store, .load = load};
    return port;
}

static void fill(kept_t *kept, unsigned value) {
    for (int i = 0; i < DATA; i++) {
        kept->data[i] = (unsigned char)(value * 41u + (unsigned)i * 13u);
    }
}

/* The value that is read after power-on; 0 = none. */
static unsigned read_value(medium_t *m, kept_t *kept) {
    const gc_port_t port = port_of(m);
    m->power = -1;
    if (gc_store_load(&port, "kept", VERSION, &kept->record, sizeof *kept) != GC_OK) {
        static const kept_t zero;
        return memcmp(kept, &zero, sizeof zero) == 0 ? 0 : 999;
    }
    for (unsigned value = 1; value < 50; value++) {
        kept_t wanted;
        fill(&wanted, value);
        if (memcmp(wanted.data, kept->data, DATA) == 0) {
            return value;
        }
    }
    return 999;
}

static void expect(unsigned got, unsigned a, unsigned b, const char *where, long cut) {
    if (got != a && got != b) {
        printf("%s, cut after %ld bytes: read %u, wanted %u or %u\n", where, cut, got, a, b);
        exit(1);
    }
}

static void save(medium_t *m, kept_t *kept, unsigned value) {
    const gc_port_t port = port_of(m);
    fill(kept, value);
    (void)gc_store_save(&port, "kept", VERSION, &kept->record, sizeof *kept);
}

/* Writes 1 .. written, loses power in the next write, comes back, writes on. */
static void cut_in_write(unsigned written, long cut) {
    static medium_t m;
    kept_t kept = {0};
    memset(&m, 0, sizeof m);
    m.power = -1;
    for (unsigned value = 1; value <= written; value++) {
        save(&m, &kept, value);
    }
    m.power = cut;
    save(&m, &kept, written + 1);
    const unsigned whole = cut == (long)sizeof kept;
    const unsigned got = read_value(&m, &kept);
    expect(got, written + whole, written + whole, "after the cut", cut);
    for (unsigned value = 20; value < 24; value++) { /* and it goes on, with a second cut in between */
        save(&m, &kept, value);
        expect(read_value(&m, &kept), value, value, "after power-on", cut);
    }
    m.power = cut;
    save(&m, &kept, 24);
    expect(read_value(&m, &kept), 23 + whole, 23 + whole, "after the second cut", cut);
}

static void flip_every_bit(void) {
    static medium_t m;
    kept_t kept = {0};
    memset(&m, 0, sizeof m);
    m.power = -1;
    save(&m, &kept, 1);
    save(&m, &kept, 2);
    const int newest = (int)(kept.record.sequence & 1u);
    for (size_t bit = 0; bit < 8 * sizeof kept; bit++) {
        m.slot[newest][bit / 8] ^= (unsigned char)(1u << bit % 8);
        expect(read_value(&m, &kept), 1, 1, "newest damaged", (long)bit);
        m.slot[newest][bit / 8] ^= (unsigned char)(1u << bit % 8);
    }
    expect(read_value(&m, &kept), 2, 2, "mended", 0);
}

static void wrap_and_refuse(void) {
    static medium_t m;
    kept_t kept = {.record = {.sequence = 0xFFFFFFFDu}};
    m.power = -1;
    for (unsigned value = 1; value < 8; value++) {
        save(&m, &kept, value);
        expect(read_value(&m, &kept), value, value, "wrap", (long)value);
    }
    m.refuses = 1;
    const gc_port_t port = port_of(&m);
    if (gc_store_save(&port, "kept", VERSION, &kept.record, sizeof kept) != GC_E_STORE) {
        printf("a refusal is not told\n");
        exit(1);
    }
    m.refuses = 0;
    expect(read_value(&m, &kept), 7, 7, "refused", 0);
    if (gc_store_load(&port, "kept", VERSION + 1u, &kept.record, sizeof kept) != GC_E_STORE ||
        gc_store_load(&port, "kept", VERSION, &kept.record, sizeof kept - 4) != GC_E_STORE) {
        printf("another version or size is taken\n");
        exit(1);
    }
    const gc_port_t bare = {.context = &m};
    if (gc_store_save(&bare, "kept", VERSION, &kept.record, sizeof kept) != GC_E_STORE ||
        gc_store_load(&bare, "kept", VERSION, &kept.record, sizeof kept) != GC_E_STORE) {
        printf("a board without a store is taken for one\n");
        exit(1);
    }
}

int main(void) {
    static medium_t m;
    kept_t kept = {0};
    for (unsigned written = 0; written < 4; written++) {
        for (long cut = 0; cut <= (long)sizeof kept; cut++) {
            cut_in_write(written, cut);
        }
    }
    flip_every_bit();
    wrap_and_refuse();
    m.power = -1;
    save(&m, &kept, 5);
    printf("ok");
    for (size_t i = 0; i < sizeof kept; i++) {
        printf(" %02x", m.slot[kept.record.sequence & 1u][i]);
    }
    printf("\n");
    return 0;
}
