#ifndef ESP_TASK_WDT_H
#define ESP_TASK_WDT_H

#include "esp_timer.h"
#include "freertos/FreeRTOS.h"

extern "C" {
esp_err_t esp_task_wdt_init(uint32_t timeout_s, bool panic);
esp_err_t esp_task_wdt_add(TaskHandle_t task);
esp_err_t esp_task_wdt_reset();
}

#endif
