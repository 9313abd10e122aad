#include "flash_store.h"

#define PARTITION "gyrocal"

void FlashStore::begin(unsigned imu) {
    const char name[] = {'i', 'm', 'u', static_cast<char>('0' + imu), '\0'};
    preferences_.begin(name, false, PARTITION);
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
