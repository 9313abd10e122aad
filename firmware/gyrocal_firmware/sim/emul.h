/* The register file that emulates the part of part.h. emul_lsm6dso.h documents each function. */
#ifndef EMUL_H
#define EMUL_H

#include "emul_lsm6dso.h"

typedef emul_lsm6dso_t emul_t;

#define emul_clock_for emul_lsm6dso_clock_for
#define emul_power_on emul_lsm6dso_power_on
#define emul_brown_out emul_lsm6dso_brown_out
#define emul_feed emul_lsm6dso_feed
#define emul_batches emul_lsm6dso_batches
#define emul_advance emul_lsm6dso_advance
#define emul_write emul_lsm6dso_write
#define emul_read emul_lsm6dso_read

#endif
