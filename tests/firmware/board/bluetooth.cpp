/* A reader by Bluetooth. What it is told goes to stderr, a line for each notification: `ble`, its length and its bytes, newlines
   as /. Calls of the port's callbacks come at once, not from a task of Bluetooth. */
#include "BLE2902.h"
#include "BLEDevice.h"
#include "simulated_board.h"

#include <algorithm>
#include <cstdio>
#include <istream>
#include <string>

#define CONNECTION 3

static void (*look)(esp_gatts_cb_event_t, esp_gatt_if_t, esp_ble_gatts_cb_param_t *);
static BLEServer server;
static BLEService service;
static BLECharacteristic hears, tells;
static BLEAdvertising advertising;
static BLEServerCallbacks *comings;
static BLECharacteristicCallbacks *hearings;
static std::string heard, told;
static bool is_on_air, is_there, is_subscribed;

void BLEDevice::init(const char *name) {
    fprintf(stderr, "ble name %s\n", name);
}

void BLEDevice::setMTU(uint16_t) {
}

void BLEDevice::setCustomGattsHandler(void (*handler)(esp_gatts_cb_event_t, esp_gatt_if_t, esp_ble_gatts_cb_param_t *)) {
    look = handler;
}

BLEServer *BLEDevice::createServer() {
    return &server;
}

BLEAdvertising *BLEDevice::getAdvertising() {
    return &advertising;
}

void BLEDevice::startAdvertising() {
    is_on_air = true;
}

void BLEAdvertising::addServiceUUID(const char *uuid) {
    fprintf(stderr, "ble service %s\n", uuid);
}

void BLEServer::setCallbacks(BLEServerCallbacks *callbacks) {
    comings = callbacks;
}

BLEService *BLEServer::createService(const char *) {
    return &service;
}

void BLEServer::disconnect(uint16_t connection) {
    if (is_there && connection == CONNECTION) {
        fprintf(stderr, "ble closed\n");
        is_there = false;
        comings->onDisconnect(this);
    }
}

BLECharacteristic *BLEService::createCharacteristic(const char *uuid, uint32_t properties) {
    fprintf(stderr, "ble characteristic %s\n", uuid);
    return properties == BLECharacteristic::PROPERTY_NOTIFY ? &tells : &hears;
}

void BLEService::start() {
}

void BLECharacteristic::addDescriptor(BLE2902 *) {
}

void BLECharacteristic::setCallbacks(BLECharacteristicCallbacks *callbacks) {
    hearings = callbacks;
}

void BLECharacteristic::setValue(uint8_t *data, size_t n) {
    told.assign(reinterpret_cast<char *>(data), n);
}

void BLECharacteristic::notify() {
    std::replace(told.begin(), told.end(), '\n', '/');
    if (is_there) {
        fprintf(stderr, "ble %zu %s\n", told.size(), told.c_str());
    }
}

uint8_t *BLECharacteristic::getData() {
    return reinterpret_cast<uint8_t *>(&heard[0]);
}

size_t BLECharacteristic::getLength() {
    return heard.size();
}

bool BLE2902::getNotifications() {
    return is_subscribed;
}

void BLE2902::setNotifications(bool on) {
    is_subscribed = on;
}

static void come(std::istream &words) {
    if (!is_on_air) {
        fprintf(stderr, "ble not on the air\n");
        return;
    }
    esp_ble_gatts_cb_param_t what = {};
    what.connect.conn_id = CONNECTION;
    is_on_air = false;
    is_there = true;
    comings->onConnect(&server, &what);
    uint16_t mtu = 0;
    if (words >> mtu) {
        what.mtu.mtu = mtu;
        look(ESP_GATTS_MTU_EVT, 0, &what);
    }
    is_subscribed = true;
}

void act_by_bluetooth(const std::string &word, std::istream &words) {
    esp_ble_gatts_cb_param_t what = {};
    if (word == "comes") {
        come(words);
    } else if (word == "says") {
        std::getline(words >> std::ws, heard);
        heard += '\n';
        hearings->onWrite(&hears);
    } else if (word == "leaves") {
        server.disconnect(CONNECTION);
    } else {
        what.congest.congested = word == "stalls";
        look(ESP_GATTS_CONGEST_EVT, 0, &what);
    }
}
