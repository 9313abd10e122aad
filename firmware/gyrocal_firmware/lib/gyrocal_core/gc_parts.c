#include "gc_parts.h"

#include "gc_bmi088.h"
#include "gc_bmi270.h"
#include "gc_icm20948.h"
#include "gc_icm42688.h"
#include "gc_lsm6dso.h"
#include "gc_lsm6dsv.h"
#include "gc_mpu6050.h"

/* Of parts with one id and address, the first is taken unless the setting `sensor` names another. */
const gc_part_t *const gc_parts[] = {
    &gc_lsm6dso,  &gc_lsm6dsox, &gc_lsm6dso32, &gc_lsm6dsr, &gc_lsm6ds3trc, &gc_lsm6ds3,
    &gc_mpu6050,  &gc_mpu6500,  &gc_mpu9250,   &gc_mpu9255, &gc_icm42688,   &gc_icm20948,
    &gc_bmi270,   &gc_bmi088,   &gc_lsm6dsv,   NULL,
};
