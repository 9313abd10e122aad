/* gc_port.h's store and load for one sensor, in the NVS partition `gyrocal` (partitions.csv), which flashing leaves alone. */
#ifndef FLASH_STORE_H
#define FLASH_STORE_H

#include <Preferences.h>

class FlashStore {
public:
    static void forget_older();
    void begin(unsigned bus, uint8_t address);
    int store(const char *key, const void *data, size_t n);
    int load(const char *key, void *data, size_t n);

private:
    Preferences preferences_;
};

#endif
