#ifndef BLE2902_H
#define BLE2902_H

class BLE2902 {
public:
    bool getNotifications();
    void setNotifications(bool on);
};

#endif
