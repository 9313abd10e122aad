/* Implements store and load of gc_port.h for one sensor, in the NVS partition `gyrocal` (partitions.csv). Flashing the firmware
   does not erase this partition. */
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
