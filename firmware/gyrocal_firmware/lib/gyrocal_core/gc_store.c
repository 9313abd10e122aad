#include "gc_store.h"

#include "gc_error.h"

#include <stdbool.h>
#include <string.h>

#define KEY_BYTES (GC_STORE_KEY_MAX + 2u)

uint32_t gc_crc32(uint32_t before, const void *data, size_t n) {
    const uint8_t *byte = data;
    uint32_t crc = before ^ 0xFFFFFFFFu;
    for (size_t i = 0; i < n; i++) {
        crc ^= byte[i];
        for (int bit = 0; bit < 8; bit++) {
            crc = crc & 1u ? crc >> 1 ^ 0xEDB88320u : crc >> 1;
        }
    }
    return crc ^ 0xFFFFFFFFu;
}

static uint32_t crc_of(const gc_record_t *record, size_t n) {
    return gc_crc32(0, (const uint8_t *)record + sizeof record->crc, n - sizeof record->crc);
}

/* A write's number says which slot it goes to. */
static void slot_key(const char *key, uint32_t sequence, char out[KEY_BYTES]) {
    const size_t n = strlen(key);
    memcpy(out, key, n);
    out[n] = sequence & 1u ? 'b' : 'a';
    out[n + 1u] = '\0';
}

int gc_store_save(const gc_port_t *port, const char *key, uint32_t version, gc_record_t *record, size_t n) {
    char name[KEY_BYTES];
    const uint32_t before = record->sequence;
    if (port->store == NULL) {
        return GC_E_STORE;
    }
    record->sequence = before + 1u != 0u ? before + 1u : 2u; /* 0 means never, and the slots alternate */
    record->version = version;
    record->n = (uint32_t)n;
    record->crc = crc_of(record, n);
    slot_key(key, record->sequence, name);
    if (port->store(port->context, name, record, n) < 0) {
        record->sequence = before;
        return GC_E_STORE;
    }
    return GC_OK;
}

static bool load_slot(const gc_port_t *port, const char *key, uint32_t slot, uint32_t version, gc_record_t *record, size_t n) {
    char name[KEY_BYTES];
    slot_key(key, slot, name);
    return port->load(port->context, name, record, n) == (int)n && record->n == n && record->version == version &&
           (record->sequence & 1u) == slot && record->crc == crc_of(record, n);
}

int gc_store_load(const gc_port_t *port, const char *key, uint32_t version, gc_record_t *record, size_t n) {
    bool found = false;
    if (port->load != NULL) {
        const bool a = load_slot(port, key, 0, version, record, n);
        const uint32_t sequence = a ? record->sequence : 0u;
        found = load_slot(port, key, 1, version, record, n);
        if (a && (!found || (int32_t)(sequence - record->sequence) > 0)) {
            found = load_slot(port, key, 0, version, record, n);
        }
    }
    if (!found) {
        memset(record, 0, n);
    }
    return found ? GC_OK : GC_E_STORE;
}
