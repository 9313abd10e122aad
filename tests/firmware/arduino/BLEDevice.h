#ifndef BLEDEVICE_H
#define BLEDEVICE_H

#include "BLEServer.h"

class BLEAdvertising {
public:
    void addServiceUUID(const char *uuid);
};

class BLEDevice {
public:
    static void init(const char *name);
    static void setMTU(uint16_t mtu);
    static void setCustomGattsHandler(void (*handler)(esp_gatts_cb_event_t, esp_gatt_if_t, esp_ble_gatts_cb_param_t *));
    static BLEServer *createServer();
    static BLEAdvertising *getAdvertising();
    static void startAdvertising();
};

#endif
