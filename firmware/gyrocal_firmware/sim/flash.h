/* The flash of the board. Its records have names and survive a power cycle. */
#ifndef FLASH_H
#define FLASH_H

#include <stddef.h>
#include <stdint.h>

#define FLASH_RECORDS 8u
#define FLASH_RECORD_MAX 16384u
#define FLASH_KEY_MAX 16u

typedef struct {
    struct {
        char key[FLASH_KEY_MAX];
        size_t n;
        uint8_t data[FLASH_RECORD_MAX];
    } record[FLASH_RECORDS];
} flash_t;

/* Writes the first n bytes of a record and keeps the bytes beyond them. Returns 0, or -1 if there is no room. */
int flash_write(flash_t *flash, const char *key, const void *data, size_t n);
/* Returns the number of bytes read, or -1 if there is no such record. */
int flash_read(const flash_t *flash, const char *key, void *data, size_t n);

#endif
