/* Data that survive power-off, also a loss of power at any instant while they are written.
 *
 * Each key has two slots at the board, `<key>a` and `<key>b`. A write goes to the one that does not hold the newest, so the
 * newest stays until the next is whole; a read takes the newest whole one. The record is the first member of what is kept:
 *
 *     struct { gc_record_t record; int32_t speed; ... } kept;
 *     gc_store_load(port, "motor", VERSION, &kept.record, sizeof kept);
 *     kept.speed = 3;
 *     gc_store_save(port, "motor", VERSION, &kept.record, sizeof kept);
 */
#ifndef GC_STORE_H
#define GC_STORE_H

#include "gc_port.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GC_STORE_KEY_MAX 11 /* letters of a key; ESP32's NVS takes 15, sensor number and slot included */

typedef struct {
    uint32_t crc;      /* CRC-32 (IEEE 802.3) of everything after it */
    uint32_t sequence; /* number of the write; 0 = never written */
    uint32_t version;  /* version of the data's layout */
    uint32_t n;        /* bytes, this record included */
} gc_record_t;

/* Continues the CRC-32 (IEEE 802.3) `before`, which is 0 at first, by n bytes. */
uint32_t gc_crc32(uint32_t before, const void *data, size_t n);

/* Saves n bytes from record on, in the byte order of this CPU. Returns GC_E_STORE if the board failed or has no store; the record
   that was kept before is then still there. */
int gc_store_save(const gc_port_t *port, const char *key, uint32_t version, gc_record_t *record, size_t n);

/* Loads n bytes. Returns GC_E_STORE and sets them all to 0 if no whole record of this version and size is kept. */
int gc_store_load(const gc_port_t *port, const char *key, uint32_t version, gc_record_t *record, size_t n);

#ifdef __cplusplus
}
#endif

#endif
