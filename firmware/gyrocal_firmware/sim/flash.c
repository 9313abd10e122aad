#include "flash.h"

#include <string.h>

int flash_write(flash_t *flash, const char *key, const void *data, size_t n) {
    if (n > FLASH_RECORD_MAX || strlen(key) >= FLASH_KEY_MAX) {
        return -1;
    }
    for (unsigned i = 0; i < FLASH_RECORDS; i++) {
        if (flash->record[i].key[0] == '\0') {
            strcpy(flash->record[i].key, key);
        }
        if (strcmp(flash->record[i].key, key) == 0) {
            memcpy(flash->record[i].data, data, n);
            flash->record[i].n = n > flash->record[i].n ? n : flash->record[i].n;
            return 0;
        }
    }
    return -1;
}

int flash_read(const flash_t *flash, const char *key, void *data, size_t n) {
    for (unsigned i = 0; i < FLASH_RECORDS; i++) {
        if (flash->record[i].key[0] != '\0' && strcmp(flash->record[i].key, key) == 0) {
            const size_t given = n < flash->record[i].n ? n : flash->record[i].n;
            memcpy(data, flash->record[i].data, given);
            return (int)given;
        }
    }
    return -1;
}
