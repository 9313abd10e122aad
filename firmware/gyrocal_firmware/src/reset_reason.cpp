#include "reset_reason.h"

const char *reset_reason_name(esp_reset_reason_t reason) {
    switch (reason) {
    case ESP_RST_POWERON:
        return "power-on";
    case ESP_RST_EXT:
        return "reset pin";
    case ESP_RST_SW:
        return "by the program";
    case ESP_RST_PANIC:
        return "crash of the program";
    case ESP_RST_INT_WDT:
        return "watchdog of an interrupt";
    case ESP_RST_TASK_WDT:
        return "watchdog of a task";
    case ESP_RST_WDT:
        return "another watchdog";
    case ESP_RST_DEEPSLEEP:
        return "deep sleep";
    case ESP_RST_BROWNOUT:
        return "brown-out";
    default:
        return "unknown";
    }
}
