/* Implements store and load of gc_port.h for one sensor, or for the board itself, in the NVS partition `gyrocal` (partitions.csv). Flashing the firmware
   does not erase this partition. */
#ifndef FLASH_STORE_H
#define FLASH_STORE_H

#include <Preferences.h>

class FlashStore {
public:
    /* To be called before any other. */
    static void prepare();
    /* Returns false if there is no such flash. */
    bool begin(const char *name);
    void begin(unsigned bus, uint8_t address);
    int store(const char *key, const void *data, size_t n);
    int load(const char *key, void *data, size_t n);

private:
    static void forget_older();

    Preferences preferences_;
};

#endif
