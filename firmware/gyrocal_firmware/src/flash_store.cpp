#include "flash_store.h"

#include "board.h"
#include "output.h"

#include <nvs_flash.h>
#include <stdio.h>

#define PARTITION "gyrocal"
#define NAME_BYTES 16

/* A partition whose pages are all in use, or of another version, can only be erased: nothing in it can be read. */
void FlashStore::prepare() {
    esp_err_t error = nvs_flash_init_partition(PARTITION);
    if (error == ESP_ERR_NVS_NO_FREE_PAGES || error == ESP_ERR_NVS_NEW_VERSION_FOUND) {
        output_say("the flash for results is erased (%s): settings and results begin anew", esp_err_to_name(error));
        error = nvs_flash_erase_partition(PARTITION);
        error = error == ESP_OK ? nvs_flash_init_partition(PARTITION) : error;
    }
    if (error == ESP_ERR_NOT_FOUND) {
        output_say("no partition " PARTITION " in flash: flash the board with partitions.csv");
    } else if (error != ESP_OK) {
        output_say("the flash for results fails (%s)", esp_err_to_name(error));
    } else {
        forget_older();
    }
}

void FlashStore::begin(unsigned bus, uint8_t address) {
    char name[NAME_BYTES];
    snprintf(name, sizeof name, "bus%u_%02X", bus, static_cast<unsigned>(address));
    if (!begin(name)) {
        output_say("%s: its flash cannot be opened, results hold until power-off", name);
    }
}

bool FlashStore::begin(const char *name) {
    return preferences_.begin(name, false, PARTITION);
}

/* Earlier versions stored records by the order in which sensors answered. The sensor of such a record is unknown. */
void FlashStore::forget_older() {
    for (unsigned imu = 0; imu < MAX_SENSORS; imu++) {
        const char name[] = {'i', 'm', 'u', static_cast<char>('0' + imu), '\0'};
        Preferences older;
        if (older.begin(name, true, PARTITION)) { /* read-only, so that a missing partition is not created */
            older.end();
            if (older.begin(name, false, PARTITION) && !older.clear()) {
                output_say("%s: records of an earlier version stay in flash, where nothing reads them", name);
            }
        }
        older.end();
    }
}

int FlashStore::store(const char *key, const void *data, size_t n) {
    return preferences_.putBytes(key, data, n) == n ? 0 : -1;
}

int FlashStore::load(const char *key, void *data, size_t n) {
    const size_t kept = preferences_.isKey(key) ? preferences_.getBytesLength(key) : 0;
    if (kept == 0 || kept > n) {
        return -1;
    }
    return static_cast<int>(preferences_.getBytes(key, data, n));
}
