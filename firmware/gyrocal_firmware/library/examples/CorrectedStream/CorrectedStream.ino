/* Rates corrected by a calibration: true rate = (reading - bias) / (1 + scale). The numbers are those of the $CAL lines that
   Calibrate sends, or of `gyrocal calibrate`; each sensor has its own. */
#include <gyrocal_arduino.h>

static const double SCALE[3] = {0.0, 0.0, 0.0034};
static const double BIAS_DPS[3] = {0.0, 0.0, -0.0835};
static const double RATE_HZ = 100.0;

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
    part_setup.odr_hz = part != nullptr ? gc_part_odr_for(part, RATE_HZ) : 0.0;
    part_setup.full_scale_dps = 250.0;
    ready = address != 0 && gc_sensor_init(&imu, part, board.port(), address, &part_setup) == GC_OK;
    Serial.println(ready ? part->name : "no sensor: check the wiring");
}

void loop() {
    gc_sample_t sample;
    if (!ready || gc_sensor_read(&imu, &sample) != GC_OK || !sample.fresh) {
        return;
    }
    for (int i = 0; i < 3; i++) {
        const double reading_dps = imu.lsb_dps * sample.gyro[i];
        Serial.print((reading_dps - BIAS_DPS[i]) / (1.0 + SCALE[i]), 4);
        Serial.print(i < 2 ? " " : "\n");
    }
    delay(static_cast<unsigned long>(1000.0 / RATE_HZ) - 1u);
}
