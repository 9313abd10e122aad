/* What all emulated parts measure: the world in the raw counts of a ROWS file, which are those of an LSM6DSO. */
#ifndef EMUL_WORLD_H
#define EMUL_WORLD_H

#include <math.h>
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

#endif
