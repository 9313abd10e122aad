/* The functions of a board that the core calls. Callbacks marked optional may be NULL. */
#ifndef GC_PORT_H
#define GC_PORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum { GC_LED_IDLE, GC_LED_RECORDING, GC_LED_FLIP, GC_LED_DONE, GC_LED_MISFIT } gc_led_t;

/* Words of the command `wifi`; GC_WIFI_STATE stands for none. */
typedef enum {
    GC_WIFI_STATE,
    GC_WIFI_NAME,
    GC_WIFI_PASSWORD,
    GC_WIFI_TOKEN,
    GC_WIFI_ON,
    GC_WIFI_OFF,
    GC_WIFI_FORGET,
    GC_WIFI_WORDS
} gc_wifi_word_t;

typedef struct {
    const char *state; /* off, joining or joined */
    char host[32];     /* its name in the network, without a domain; empty unless it has joined */
    char address[16];  /* likewise */
    unsigned port;
    bool reader;      /* somebody who knew the token is connected */
    uint32_t refused; /* connections without the right token */
} gc_wifi_state_t;

/* How a part, or one of its dies, speaks SPI. Bytes go with their highest bit first; the first one names a register, and its highest
   bit says that it is read. */
typedef struct {
    uint32_t most_hz;   /* of the clock, at any register */
    uint8_t mode;       /* of the clock's polarity and phase, 0 to 3 */
    uint8_t dummies;    /* bytes before what is read */
    bool starts_as_i2c; /* until its chip select has risen once after power-on and after each reset, it answers nothing */
    uint8_t i2c_off_reg, i2c_off; /* the register, and its bits, by which it no longer takes a bus for I2C; 0 = it has none */
} gc_spi_t;

typedef struct {
    void *context; /* passed to every callback */

    /* By I2C: write and read registers of the part at a 7-bit address. Return 0, or the number of bytes read; negative on error. */
    int (*bus_write)(void *context, uint8_t address, uint8_t reg, const uint8_t *data, size_t n);
    int (*bus_read)(void *context, uint8_t address, uint8_t reg, uint8_t *data, size_t n);
    /* By SPI, instead of both: with the chip select of a die low (0, or 1 where a part has two), sends n_out bytes and then
       receives n_in. Returns 0; negative on error. `how` tells clock and mode; the core has put the rest into `out`. */
    int (*spi)(void *context, unsigned die, const gc_spi_t *how, const uint8_t *out, size_t n_out, uint8_t *in, size_t n_in);

    /* Returns the microseconds since power-on; it never decreases. */
    uint64_t (*now_us)(void *context);
    void (*wait_until_us)(void *context, uint64_t t_us);
    /* Optional: returns when the next sample should be read, at due_us unless the port knows better. NULL: wait_until_us. */
    void (*wait_sample_us)(void *context, uint64_t due_us);
    /* Optional: when the last transfer got the bus, for which it may have waited. NULL: no transfer waits. */
    uint64_t (*bus_us)(void *context);
    /* Optional, where the sensor's interrupt pin is wired: returns when it is high, at deadline_us at the latest. The result is
       the time at which it last rose, or 0 if the port does not know. */
    uint64_t (*wait_ready_us)(void *context, uint64_t deadline_us);

    /* Takes all n bytes and returns n, or takes none and returns anything else: it must not block sampling. */
    int (*send)(void *context, const char *data, size_t n);

    /* Optional: keep data over power-off. Return 0, or the number of bytes loaded; negative on error. */
    int (*store)(void *context, const char *key, const void *data, size_t n);
    int (*load)(void *context, const char *key, void *data, size_t n);
    /* Optional: returns false while a store would stall another device of the board. The core then asks again. */
    bool (*may_store)(void *context);

    /* Optional: starts the board again; does not return. */
    void (*restart)(void *context);

    /* Optional: the least memory that has been free since power-on, in all and on the stack of the calling task, bytes. */
    void (*least_free)(void *context, uint32_t *heap_bytes, uint32_t *stack_bytes);

    /* Optional: the file of its maker that a part must be given at each start, and its size; NULL if the board does not have it. */
    const uint8_t *(*part_file)(void *context, const char *part, size_t *n);

    /* Optional: shows the state of the device. */
    void (*led)(void *context, gc_led_t state);

    /* Optional, on a board with Wi-Fi: obeys a word with its text (gc_wifi.h), and returns GC_OK or an error. */
    int (*wifi)(void *context, gc_wifi_word_t word, const char *text, size_t n);
    /* With `wifi`: how it stands. */
    void (*wifi_state)(void *context, gc_wifi_state_t *state);
} gc_port_t;

#ifdef __cplusplus
}
#endif

#endif
