#ifndef WIFI_H
#define WIFI_H

#include "Arduino.h"

#include <string>

/* The part of Arduino's that the port uses. */
class String : public std::string {
public:
    using std::string::string;
};

class IPAddress {
public:
    String toString() const;
};

typedef enum { WIFI_STA = 1 } wifi_mode_t;
typedef enum { WL_IDLE_STATUS = 0, WL_NO_SSID_AVAIL = 1, WL_CONNECTED = 3, WL_CONNECT_FAILED = 4, WL_DISCONNECTED = 6 } wl_status_t;

class WiFiClass {
public:
    void persistent(bool persistent);
    static bool setHostname(const char *name);
    bool mode(wifi_mode_t mode);
    wl_status_t begin(const char *name, const char *password = nullptr);
    bool disconnect(bool off = false);
    static wl_status_t status();
    IPAddress localIP();
    uint8_t *macAddress(uint8_t *mac);
};

extern WiFiClass WiFi;

#endif
