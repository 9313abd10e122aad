/* The whole calibrator on one sensor: runs, answers and commands as text, which any serial monitor or `gyrocal monitor` shows.
 * Needs about 40 KB of RAM. Put the sensor on a table that turns at a known rate, its z axis up, and send
 *
 *     set table_dps 78
 *     start up          stop after 6 s or more, turn the sensor over
 *     stop
 *     start down        and the same again
 *     stop
 *
 * A sensor by SPI: GYROCAL_CS is the pin of its chip select, the others are those of the board's SPI (docs/first-hour.md).
 *
 * The lines that begin with $CAL are the answers; CorrectedStream uses their scale and bias_dps. */
#include <gyrocal_arduino.h>

#if defined(GYROCAL_CS)
static GyrocalPort board(SPI, GYROCAL_CS, &Serial);
#else
static GyrocalPort board(Wire, &Serial);
#endif
static gc_device_config_t config;
static gc_device_t device;

void setup() {
    Serial.begin(921600);
#if defined(GYROCAL_CS)
    SPI.begin();
    board.begin_selects();
#else
    Wire.begin();
    Wire.setClock(400000);
#endif
    delay(100); /* start-up time of the slowest sensor */
    const uint8_t address = board.find(nullptr);
    config.port = board.port();
    config.parts = gc_parts;
    config.address = address != 0 ? address : 0x6B; /* without a sensor, bus_nack is reported until one answers */
    config.calibration = gyrocal_calibration;
    config.net = gyrocal_net;
    gc_device_init(&device, &config);
}

void loop() {
    while (Serial.available() > 0) {
        const char byte = static_cast<char>(Serial.read());
        gc_device_receive(&device, &byte, 1);
    }
    gc_device_step(&device);
}
