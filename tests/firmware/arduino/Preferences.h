#ifndef PREFERENCES_H
#define PREFERENCES_H

#include "Arduino.h"

class Preferences {
public:
    bool begin(const char *name, bool read_only = false, const char *partition_label = nullptr);
    void end();
    bool clear();
    bool isKey(const char *key);
    size_t putBytes(const char *key, const void *value, size_t length);
    size_t getBytesLength(const char *key);
    size_t getBytes(const char *key, void *buffer, size_t length);
};

#endif
