/* What all emulated parts measure: the world in the raw counts of a ROWS file, which are those of an LSM6DSO. */
#ifndef EMUL_WORLD_H
#define EMUL_WORLD_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#define EMUL_WORDS 7 /* temperature, gyroscope x y z, accelerometer x y z */
#define EMUL_WORLD_DPS_OF_SCALE 3.5e-5 /* one count of the gyroscope over its full scale */
#define EMUL_WORLD_G 0.000061
#define EMUL_WORLD_C (1.0 / 256.0)
#define EMUL_WORLD_ZERO_C 25.0

static inline int16_t emul_counts(double x) {
    x = rint(x);
    return (int16_t)(x > 32767.0 ? 32767.0 : x < -32768.0 ? -32768.0 : x);
}

#define EMUL_ALL_AXES 7u

/* Whether an axis is among those of which the self-test moves nothing, a bit each. */
static inline bool emul_is_stuck(uint8_t stuck_axes, int axis) {
    return (stuck_axes >> axis & 1) != 0;
}

/* By what the self-test of an InvenSense part moved an axis at the factory, which burnt this code. */
static inline double emul_dps_of_code(uint8_t code) {
    return 2620.0 / 131.0 * pow(1.01, code - 1.0);
}

#endif
