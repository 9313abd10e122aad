/* The drivers alone: the rates and the temperature of whichever sensor is connected, in deg/s and degC. */
#include <gyrocal_arduino.h>

static GyrocalPort board(Wire);
static gc_sensor_t imu;
static bool ready;

void setup() {
    Serial.begin(921600);
    Wire.begin();
    Wire.setClock(400000);
    delay(100);
    const gc_part_t *part = nullptr;
    const uint8_t address = board.find(&part);
    gc_setup_t part_setup = {};
    part_setup.odr_hz = part != nullptr ? gc_part_odr_for(part, 145.0) : 0.0;
    part_setup.full_scale_dps = 250.0;
    ready = address != 0 && gc_sensor_init(&imu, part, board.port(), address, &part_setup) == GC_OK;
    Serial.println(ready ? part->name : "no sensor: check the wiring");
}

void loop() {
    gc_sample_t sample;
    const int error = ready ? gc_sensor_read(&imu, &sample) : GC_E_NOT_READY;
    if (error != GC_OK) {
        Serial.println(gc_error_advice(error));
        delay(1000);
        return;
    }
    if (sample.fresh) {
        for (const int16_t counts : sample.gyro) {
            Serial.print(imu.lsb_dps * counts, 3);
            Serial.print(" ");
        }
        Serial.println(gc_sensor_temp_c(imu.part, sample.temp, 1), 2);
    }
}
