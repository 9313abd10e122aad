#ifndef BLESERVER_H
#define BLESERVER_H

#include <stddef.h>
#include <stdint.h>

typedef enum { ESP_GATTS_MTU_EVT = 4, ESP_GATTS_CONGEST_EVT = 20 } esp_gatts_cb_event_t;
typedef uint8_t esp_gatt_if_t;

typedef union {
    struct {
        uint16_t conn_id;
    } connect;
    struct {
        uint16_t conn_id, mtu;
    } mtu;
    struct {
        uint16_t conn_id;
        bool congested;
    } congest;
} esp_ble_gatts_cb_param_t;

class BLEServer;
class BLECharacteristic;
class BLE2902;

class BLEServerCallbacks {
public:
    virtual ~BLEServerCallbacks() {}
    virtual void onConnect(BLEServer *, esp_ble_gatts_cb_param_t *) {}
    virtual void onDisconnect(BLEServer *) {}
};

class BLECharacteristicCallbacks {
public:
    virtual ~BLECharacteristicCallbacks() {}
    virtual void onWrite(BLECharacteristic *) {}
};

class BLECharacteristic {
public:
    static const uint32_t PROPERTY_WRITE = 1, PROPERTY_NOTIFY = 2, PROPERTY_WRITE_NR = 4;
    void addDescriptor(BLE2902 *descriptor);
    void setCallbacks(BLECharacteristicCallbacks *callbacks);
    void setValue(uint8_t *data, size_t n);
    void notify();
    uint8_t *getData();
    size_t getLength();
};

class BLEService {
public:
    BLECharacteristic *createCharacteristic(const char *uuid, uint32_t properties);
    void start();
};

class BLEServer {
public:
    void setCallbacks(BLEServerCallbacks *callbacks);
    BLEService *createService(const char *uuid);
    void disconnect(uint16_t connection);
};

#endif
