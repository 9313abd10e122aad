#ifndef FREERTOS_H
#define FREERTOS_H

#include <stddef.h>
#include <stdint.h>

typedef int BaseType_t;
typedef unsigned UBaseType_t;
typedef uint32_t TickType_t;
typedef struct task *TaskHandle_t;
typedef struct semaphore *SemaphoreHandle_t;
typedef struct stream_buffer *StreamBufferHandle_t;
typedef struct ring_buffer *RingbufHandle_t;
typedef enum { RINGBUF_TYPE_NOSPLIT } RingbufferType_t;

typedef struct {
    int owner;
} portMUX_TYPE;

#define portMUX_INITIALIZER_UNLOCKED {0}
#define portENTER_CRITICAL(mux) ((void)(mux))
#define portEXIT_CRITICAL(mux) ((void)(mux))
#define pdTRUE 1
#define pdFALSE 0
#define pdPASS pdTRUE
#ifndef portNUM_PROCESSORS
#define portNUM_PROCESSORS 2
#endif
#define portMAX_DELAY 0xFFFFFFFFu
#define pdMS_TO_TICKS(ms) ((TickType_t)(ms))
#define configASSERT(x) ((void)(x))
#define portYIELD_FROM_ISR() ((void)0)

extern "C" {
BaseType_t xTaskCreate(void (*code)(void *), const char *name, uint32_t stack, void *argument, UBaseType_t priority, TaskHandle_t *task);
BaseType_t xTaskCreatePinnedToCore(void (*code)(void *), const char *name, uint32_t stack, void *argument, UBaseType_t priority,
                                   TaskHandle_t *task, BaseType_t core);
UBaseType_t uxTaskGetStackHighWaterMark(TaskHandle_t task);
BaseType_t xTaskNotifyGive(TaskHandle_t task);
uint32_t ulTaskNotifyTake(BaseType_t clear, TickType_t ticks);
void vTaskNotifyGiveFromISR(TaskHandle_t task, BaseType_t *woken);

SemaphoreHandle_t xSemaphoreCreateMutex();
BaseType_t xSemaphoreTake(SemaphoreHandle_t semaphore, TickType_t ticks);
BaseType_t xSemaphoreGive(SemaphoreHandle_t semaphore);

StreamBufferHandle_t xStreamBufferCreate(size_t bytes, size_t trigger);
size_t xStreamBufferSend(StreamBufferHandle_t buffer, const void *data, size_t n, TickType_t ticks);
size_t xStreamBufferReceive(StreamBufferHandle_t buffer, void *data, size_t n, TickType_t ticks);

RingbufHandle_t xRingbufferCreate(size_t bytes, RingbufferType_t type);
size_t xRingbufferGetCurFreeSize(RingbufHandle_t ring);
BaseType_t xRingbufferSend(RingbufHandle_t ring, const void *item, size_t n, TickType_t ticks);
void *xRingbufferReceive(RingbufHandle_t ring, size_t *n, TickType_t ticks);
void vRingbufferReturnItem(RingbufHandle_t ring, void *item);
}

#endif
