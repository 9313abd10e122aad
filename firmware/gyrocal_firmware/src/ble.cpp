#if defined(GYROCAL_BLE)

#include "ble.h"

#include "output.h"
#include "wireless.h"

#include <Arduino.h>
#include <BLE2902.h>
#include <BLEDevice.h>
#include <BLEServer.h>
#include <freertos/FreeRTOS.h>
#include <freertos/stream_buffer.h>
#include <string.h>

/* By the Nordic UART Service, seen from the board. */
#define SERVICE "6E400001-B5A3-F393-E0A9-E50E24DCCA9E"
#define HEARS "6E400002-B5A3-F393-E0A9-E50E24DCCA9E"
#define TELLS "6E400003-B5A3-F393-E0A9-E50E24DCCA9E"

#define MTU 247 /* what a packet of Bluetooth 4.2 holds; the reader says what it takes */
#define MTU_AT_FIRST 23
#define ATT_BYTES 3u /* of each packet are not ours */
#define HEARD_BYTES 512
#define PIECES_A_STEP 4 /* more do not pass in the time of a step */

static BLEServer *server;
static BLECharacteristic *tells;
static BLE2902 *subscription;
static StreamBufferHandle_t heard; /* from Bluetooth's task to the main loop */
static volatile bool is_there, is_congested;
static volatile uint16_t connection, mtu;
static bool is_taken;   /* by radio.h */
static bool is_leaving; /* was told to */
static char token[GC_TOKEN_MAX + 1];

/* These are called by Bluetooth's task. */
class Coming : public BLEServerCallbacks {
    void onConnect(BLEServer *, esp_ble_gatts_cb_param_t *what) override {
        connection = what->connect.conn_id;
        mtu = MTU_AT_FIRST;
        is_congested = false;
        is_there = true;
    }
    void onDisconnect(BLEServer *) override { is_there = false; }
};

class Hearing : public BLECharacteristicCallbacks {
    void onWrite(BLECharacteristic *from) override { xStreamBufferSend(heard, from->getData(), from->getLength(), 0); }
};

static void look_at_link(esp_gatts_cb_event_t event, esp_gatt_if_t, esp_ble_gatts_cb_param_t *what) {
    if (event == ESP_GATTS_CONGEST_EVT) {
        is_congested = what->congest.congested;
    } else if (event == ESP_GATTS_MTU_EVT) {
        mtu = what->mtu.mtu;
    }
}

static void begin() {
    heard = xStreamBufferCreate(HEARD_BYTES, 1);
    BLEDevice::init(wifi_host());
    BLEDevice::setMTU(MTU);
    BLEDevice::setCustomGattsHandler(look_at_link);
    server = BLEDevice::createServer();
    server->setCallbacks(new Coming);
    BLEService *service = server->createService(SERVICE);
    tells = service->createCharacteristic(TELLS, BLECharacteristic::PROPERTY_NOTIFY);
    subscription = new BLE2902;
    tells->addDescriptor(subscription);
    service->createCharacteristic(HEARS, BLECharacteristic::PROPERTY_WRITE | BLECharacteristic::PROPERTY_WRITE_NR)
        ->setCallbacks(new Hearing);
    service->start();
    BLEDevice::getAdvertising()->addServiceUUID(SERVICE);
    BLEDevice::startAdvertising();
    output_say("ble: on the air as %s", wifi_host());
}

static void tell(const char *data, size_t n) {
    tells->setValue(reinterpret_cast<uint8_t *>(const_cast<char *>(data)), n);
    tells->notify();
}

static size_t most_bytes() {
    return (mtu < MTU ? mtu : MTU) - ATT_BYTES;
}

static void let_go() {
    if (is_taken) {
        radio_disconnect();
        is_taken = false;
    }
}

static void hang_up(const char *note) {
    for (size_t at = 0, n = strlen(note); at < n; at += most_bytes()) {
        tell(note + at, n - at < most_bytes() ? n - at : most_bytes());
    }
    let_go();
    is_leaving = true;
    server->disconnect(connection);
}

static void hear_reader(radio_command_t command) {
    char data[64];
    size_t n;
    while ((n = xStreamBufferReceive(heard, data, sizeof data, 0)) > 0) {
        if (is_taken && !radio_hear(data, n, command)) {
            hang_up(GC_REMOTE_TOKEN_NOTE);
        }
    }
}

static void tell_reader() {
    const char *data = nullptr;
    size_t n;
    for (int i = 0; i < PIECES_A_STEP && !is_congested && subscription->getNotifications(); i++) {
        if ((n = radio_waiting(most_bytes(), &data)) == 0) {
            return;
        }
        tell(data, n);
        radio_took(n);
    }
}

static void take_up_token() {
    if (strcmp(token, wifi_token()) == 0) {
        return;
    }
    strcpy(token, wifi_token());
    if (radio_begin(token) && server == nullptr && token[0] != '\0') {
        begin();
    }
}

void ble_step(radio_command_t command) {
    take_up_token();
    if (server == nullptr) {
        return;
    }
    if (is_there && !is_taken && !is_leaving) {
        is_taken = radio_connect();
        if (!is_taken) {
            hang_up(GC_REMOTE_BUSY_NOTE);
        }
    }
    hear_reader(command);
    if (is_taken && is_there) {
        tell_reader();
    }
    if (is_taken && radio_is_over()) {
        hang_up("");
    }
    if (!is_there && (is_taken || is_leaving)) {
        let_go();
        is_leaving = false;
        subscription->setNotifications(false);
        BLEDevice::startAdvertising();
    }
}

#endif
