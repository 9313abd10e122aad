#include "gc_lsm6dso.h"

#include "gc_error.h"
#include "gc_self_test.h"
#include "gc_tagged_fifo.h"

#define TEST_208_HZ_2000_DPS 0x5Cu
#define RESET_LOOK_US 50u
enum { CTRL1, CTRL2, CTRL3, CTRL4, CTRL5, CTRL6, CTRL_REGS }; /* the watched ones */

static const gc_odr_t odrs[] = {{12.5, 1}, {26.0, 2}, {52.0, 3}, {104.0, 4}, {208.0, 5}, {416.0, 6}, {833.0, 7}, {1666.0, 8}, {3333.0, 9}, {6667.0, 10}};
static const gc_spi_t spi = {
    .most_hz = 10000000, .mode = 3, .i2c_off_reg = GC_LSM6DSO_CTRL4_C, .i2c_off = GC_LSM6DSO_CTRL4_I2C_DISABLE};
static const gc_range_t ranges[] = {
    {125.0, 0.004375, 0x02}, {250.0, 0.00875, 0x00}, {500.0, 0.0175, 0x04}, {1000.0, 0.035, 0x08}, {2000.0, 0.070, 0x0C},
};

static const gc_range_t dsr_ranges[] = {
    {125.0, 0.004375, 0x02}, {250.0, 0.00875, 0x00}, {500.0, 0.0175, 0x04}, {1000.0, 0.035, 0x08}, {2000.0, 0.070, 0x0C}, {4000.0, 0.140, 0x01},
};

static const gc_accel_t accels[] = {{2.0, 0x00}, {4.0, 0x08}, {8.0, 0x0C}, {16.0, 0x04}};
static const gc_accel_t dso32_accels[] = {{4.0, 0x00}, {8.0, 0x08}, {16.0, 0x0C}, {32.0, 0x04}};

static int burst(gc_sensor_t *imu, gc_sample_t *sample) {
    uint8_t data[14];
    const int error = gc_sensor_read_regs(imu, GC_LSM6DSO_OUT_TEMP_L, data, sizeof data);
    if (error != GC_OK) {
        return error;
    }
    sample->temp = gc_sensor_word(data[1], data[0]);
    gc_sensor_words_low_first(data + 2, sample->gyro);
    gc_sensor_words_low_first(data + 8, sample->acc);
    return GC_OK;
}

/* There is no I3C master, and the interface would take noise for its start condition. */
static int disable_i3c(gc_sensor_t *imu) {
    const bool has_i3c = (imu->part->traits & GC_LSM6_HAS_I3C) != 0u;
    return has_i3c ? gc_sensor_change_bits(imu, GC_LSM6DSO_CTRL9_XL, 0, GC_LSM6DSO_CTRL9_I3C_DISABLE) : GC_OK;
}

/* Another program may have left the bank of the embedded functions selected, where WHO_AM_I cannot be read. */
static int identify(gc_sensor_t *imu) {
    const int error = gc_sensor_write_reg(imu, GC_LSM6DSO_FUNC_CFG_ACCESS, 0);
    return error == GC_OK ? gc_sensor_check_id(imu, 0, imu->part->id_reg, imu->part->id) : error;
}

/* A part whose INT1 is high at a reset may take its bus for I3C and not answer until power-off. Data that nobody has read keep
   INT1 high, so the pin is released first. The reset itself enables I3C again. */
static int reset(gc_sensor_t *imu) {
    int error = gc_sensor_write_reg(imu, GC_LSM6DSO_INT1_CTRL, 0);
    if (error == GC_OK) {
        error = disable_i3c(imu);
    }
    if (error == GC_OK) {
        error = gc_sensor_write_reg(imu, GC_LSM6DSO_CTRL3_C, GC_LSM6DSO_CTRL3_SW_RESET | GC_LSM6DSO_CTRL3_IF_INC);
    }
    if (error == GC_OK) {
        error = gc_sensor_wait_for_bits(imu, GC_LSM6DSO_CTRL3_C, GC_LSM6DSO_CTRL3_SW_RESET, 0, RESET_LOOK_US,
                                        GC_LSM6DSO_RESET_TIMEOUT_US);
    }
    return error == GC_OK ? disable_i3c(imu) : error;
}

static int read_period(gc_sensor_t *imu) {
    uint8_t freq_fine = 0;
    const bool has_it = (imu->part->traits & GC_LSM6_HAS_FREQ_FINE) != 0u;
    const int error = has_it ? gc_sensor_read_regs(imu, GC_LSM6DSO_FREQ_FINE, &freq_fine, 1) : GC_OK;
    const int faster = freq_fine < 128u ? freq_fine : freq_fine - 256;
    const double true_hz = GC_LSM6DSO_ROOT_HZ / (double)(1u << (GC_LSM6DSO_ROOT_CODE - imu->odr->code)); /* 12.5 stands for 13.02 */
    imu->period_us = 1e6 / (true_hz * (1.0 + GC_LSM6DSO_FREQ_FINE_LSB * faster));
    return error;
}

/* The pin drives what is wired to it only where a port waits for it. */
static int route_int1(gc_sensor_t *imu, uint8_t source) {
    return imu->port->wait_ready_us != NULL ? gc_sensor_write_reg(imu, GC_LSM6DSO_INT1_CTRL, source) : GC_OK;
}

static int set_up(gc_sensor_t *imu) {
    const gc_port_t *port = imu->port;
    const uint8_t odr_bits = (uint8_t)(imu->odr->code << 4);
    imu->written[CTRL1] = (uint8_t)(odr_bits | imu->accel->code);
    imu->written[CTRL2] = (uint8_t)(odr_bits | imu->range->code);
    imu->written[CTRL3] = GC_LSM6DSO_CTRL3_BDU | GC_LSM6DSO_CTRL3_IF_INC;
    imu->written[CTRL4] = (uint8_t)((imu->low_pass > 0u ? GC_LSM6DSO_CTRL4_LPF1_SEL_G : 0u) |
                                    (imu->spi[0] != NULL ? imu->spi[0]->i2c_off : 0u));
    imu->written[CTRL5] = 0;
    imu->written[CTRL6] = imu->low_pass > 0u ? (uint8_t)(imu->low_pass - 1u) : 0u; /* FTYPE */

    port->wait_until_us(port->context, port->now_us(port->context) + GC_LSM6DSO_BOOT_US);
    int error = identify(imu);
    if (error == GC_OK) {
        error = reset(imu);
    }
    if (error == GC_OK) {
        error = read_period(imu);
    }
    if (error == GC_OK) {
        error = route_int1(imu, GC_LSM6DSO_INT1_DRDY_G);
    }
    const uint8_t order[] = {CTRL3, CTRL4, CTRL6, CTRL1, CTRL2}; /* BDU comes first, so that no word is read in two halves */
    for (size_t i = 0; i < sizeof order && error == GC_OK; i++) {
        error = gc_sensor_write_reg(imu, (uint8_t)(GC_LSM6DSO_CTRL1_XL + order[i]), imu->written[order[i]]);
    }
    if (error == GC_OK) {
        error = gc_sensor_check_config(imu, GC_E_CONFIG_REFUSED);
    }
    if (error == GC_OK) {
        port->wait_until_us(port->context, port->now_us(port->context) + GC_LSM6DSO_TURN_ON_US);
        error = burst(imu, &imu->partial); /* the first rates are discarded */
    }
    return error;
}

static int ready(gc_sensor_t *imu) {
    uint8_t status = 0;
    const int error = gc_sensor_read_regs(imu, GC_LSM6DSO_STATUS, &status, 1);
    if (error != GC_OK) {
        return error;
    }
    return (status & GC_LSM6DSO_STATUS_GDA) != 0u ? 1 : 0;
}

/* ---- FIFO ---- */

static const gc_tagged_fifo_t fifo = {.status_reg = GC_LSM6DSO_FIFO_STATUS1, .level_bits = 2, .has_parity = true,
                                      .slow_temp_hz = 12.5, .temp_hz = 52.0, .acc_code = 4, .acc_hz = 104.0};

static int fifo_begin(gc_sensor_t *imu) {
    int error = route_int1(imu, GC_LSM6DSO_INT1_FIFO_TH);
    if (error == GC_OK) {
        error = gc_sensor_write_reg(imu, GC_LSM6DSO_CTRL10_C, GC_LSM6DSO_CTRL10_TIMESTAMP);
    }
    return error == GC_OK ? gc_tagged_fifo_restart(&fifo, imu) : error;
}

static int fifo_read(gc_sensor_t *imu, gc_batch_t *batch) {
    return gc_tagged_fifo_read(&fifo, imu, batch);
}

/* ---- self-test ---- */

static int self_test(gc_sensor_t *imu, gc_self_test_t *result) {
    static const uint8_t still[][2] = {{GC_LSM6DSO_INT1_CTRL, 0}, {GC_LSM6DSO_CTRL2_G, TEST_208_HZ_2000_DPS}};
    static const uint8_t moving[][2] = {{GC_LSM6DSO_CTRL5_C, GC_LSM6DSO_CTRL5_GYRO_TEST}};
    static const gc_moving_test_t test = {
        .still = still, .stills = sizeof still / sizeof still[0], .moving = moving, .movings = 1,
        .settle_us = GC_LSM6DSO_TEST_US, .samples = 5, .lsb_dps = 0.070};
    gc_self_test_limit(result, 150.0, 700.0);
    return gc_self_test_by_change(imu, &test, result);
}

/* The strong ones end at 1667 Hz. */
static unsigned low_passes_at(double odr_hz) {
    return odr_hz > GC_FIFO_ALONE_HZ ? 4u : 8u;
}

/* The part's table of ranges; what the parts with a FIFO of tagged words have; what all of the family have. */
#define WITH_RANGES(table) .range = (table), .ranges = sizeof(table) / sizeof(table)[0]
/* Samples of at most three words: a quarter of the FIFO is left for delays. */
#define WITH_ACCELS(table) .accel = (table), .accels = sizeof(table) / sizeof(table)[0]
#define WITH_FIFO                                                                                                        \
    .traits = GC_LSM6_HAS_I3C | GC_LSM6_HAS_FREQ_FINE, .low_passes = 8, .low_passes_at = low_passes_at, .batch_max = 128, .fifo_begin = fifo_begin, .fifo_read = fifo_read
#define ALIKE                                                                                                            \
    .address = {GC_LSM6DSO_ADDRESS, GC_LSM6DSO_ADDRESS_LOW}, .spi = {&spi}, .id_reg = GC_LSM6DSO_WHO_AM_I, .odr = odrs, .odrs = sizeof odrs / sizeof odrs[0],          \
    .polled_from_hz = 416.0, .watched_reg = GC_LSM6DSO_CTRL1_XL, .watched = CTRL_REGS, .identify = identify,             \
    .set_up = set_up, .ready = ready, .read = burst, .self_test = self_test

const gc_part_t gc_lsm6dso = {
    .name = "LSM6DSO", .id = GC_LSM6DSO_ID,
    .lsb_g = 0.000061, /* at 2 g */
    .lsb_c = 1.0 / 256.0,
    .noise_dps = 0.0448, /* 3.8 mdps/sqrt(Hz) within the filter of 416 Hz */
    .zero_c = 25.0,
    WITH_RANGES(ranges), WITH_ACCELS(accels), WITH_FIFO, ALIKE,
};
const gc_part_t gc_lsm6dsox = {
    .name = "LSM6DSOX", .id = GC_LSM6DSO_ID, .lsb_g = 0.000061, .lsb_c = 1.0 / 256.0, .noise_dps = 0.0448, .zero_c = 25.0,
    WITH_RANGES(ranges), WITH_ACCELS(accels), WITH_FIFO, ALIKE,
};
const gc_part_t gc_lsm6dso32 = {
    .name = "LSM6DSO32", .id = GC_LSM6DSO_ID, .lsb_g = 0.000122, .lsb_c = 1.0 / 256.0, .noise_dps = 0.0448, .zero_c = 25.0,
    WITH_RANGES(ranges), WITH_ACCELS(dso32_accels), WITH_FIFO, ALIKE,
};
/* The density of its noise, 5 mdps/sqrt(Hz), and that of the two below, 5 and 7, are those of their datasheets. */
const gc_part_t gc_lsm6dsr = {
    .name = "LSM6DSR", .id = GC_LSM6DSR_ID, .lsb_g = 0.000061, .lsb_c = 1.0 / 256.0, .noise_dps = 0.059, .zero_c = 25.0,
    WITH_RANGES(dsr_ranges), WITH_ACCELS(accels), WITH_FIFO, ALIKE,
};
const gc_part_t gc_lsm6ds3trc = {
    .name = "LSM6DS3TR-C", .id = GC_LSM6DS3TRC_ID, .lsb_g = 0.000061, .lsb_c = 1.0 / 256.0, .noise_dps = 0.059, .zero_c = 25.0,
    WITH_RANGES(ranges), WITH_ACCELS(accels), .low_passes = 4, ALIKE,
};
const gc_part_t gc_lsm6ds3 = {
    .name = "LSM6DS3", .id = GC_LSM6DS3_ID, .lsb_g = 0.000061, .lsb_c = 1.0 / 16.0, .noise_dps = 0.083, .zero_c = 25.0,
    WITH_RANGES(ranges), WITH_ACCELS(accels), ALIKE,
};
