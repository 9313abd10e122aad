/* The emulated parts are strict: what a wrong start-up does is lost. */
#include "parts_bus.h"

static void write_reg(uint8_t reg, uint8_t value) {
    now += 70;
    (void)emul_write(&emul, now, emul.kind->address, reg, &value, 1);
}

static uint8_t read_reg(uint8_t reg) {
    uint8_t value = 0;
    now += 70;
    (void)emul_read(&emul, now, emul.kind->address, reg, &value, 1);
    return value;
}

static void check_strict_mpu6050(void) {
    emul.kind = emul_kind("MPU-6050");
    power(1.0);
    CHECK(read_reg(0x6B) == 0x40);
    write_reg(0x1B, 0x08); /* asleep */
    CHECK(read_reg(0x1B) == 0);
    write_reg(0x6B, 0x01); /* the gyroscope does not run yet: its clock cannot be taken */
    write_reg(0x1A, 0x01);
    write_reg(0x38, 0x01);
    CHECK(read_reg(0x3A) == 0 && !emul_int1(&emul));
    now += 1200;
    CHECK(!emul_int1(&emul) && read_reg(0x3A) == 1 && read_reg(0x3A) == 0);
    const double slow_us = emul.chip.mpu6050.tick_us;
    now = (uint64_t)slow_us + 1u;
    emul_advance(&emul, now);
    CHECK(fabs(emul.chip.mpu6050.tick_us - slow_us - 1000.0 / 0.97) < 1.0);
    write_reg(0x1B, 0x0C); /* bit 2 is reserved */
    CHECK(read_reg(0x1B) == 0x08);
    write_reg(0x37, 0x20);
    now += 1200;
    emul_advance(&emul, now);
    CHECK(emul_int1(&emul));
    write_reg(0x1B, 0xE8); /* the self-test is for 250 dps */
    now += 300000;
    const uint8_t at_500_dps = read_reg(0x43);
    write_reg(0x1B, 0xE0);
    now += 300000;
    CHECK(at_500_dps == 0x0A && read_reg(0x43) == 0x2A); /* 40 dps, and 43 dps more */
    write_reg(0x6B, 0x80);
    write_reg(0x1B, 0x18); /* resets */
    CHECK((read_reg(0x6B) & 0x80) != 0);
    now += 3000;
    CHECK(read_reg(0x6B) == 0x40 && read_reg(0x1B) == 0);
    write_reg(0x6B, 0);
    write_reg(0x6A, 0x10); /* off this bus */
    CHECK(emul_read(&emul, now, 0x68, 0x75, &(uint8_t){0}, 1) == -1);
}

static void check_strict_icm42688(void) {
    emul.kind = emul_kind("ICM-42688-P");
    power(1.0);
    write_reg(0x76, 1);
    CHECK(read_reg(0x75) == 0);
    write_reg(0x76, 0);
    CHECK(read_reg(0x75) == 0x47);
    write_reg(0x11, 1);
    write_reg(0x4F, 0x66); /* resets */
    now += 1000;
    CHECK(read_reg(0x2D) == 0x10 && read_reg(0x2D) == 0 && read_reg(0x4F) == 0x06);
    write_reg(0x4E, 0x0F);
    write_reg(0x4F, 0x66); /* too early after it */
    CHECK(read_reg(0x4F) == 0x06);
    now += 200;
    write_reg(0x4F, 0x76); /* bit 4 is reserved */
    CHECK(read_reg(0x4F) == 0x66);
    write_reg(0x65, 0x08);
    write_reg(0x14, 0x07);
    now += 2000;
    emul_advance(&emul, now);
    CHECK(!emul_int1(&emul)); /* INT_ASYNC_RESET is set */
    write_reg(0x64, 0);
    CHECK(emul_int1(&emul) && (read_reg(0x2D) & 8) != 0 && !emul_int1(&emul));
}

static void check_strict_older(void) {
    emul.kind = emul_kind("LSM6DS3TR-C");
    power(1.0);
    write_reg(0x0A, 0x06);
    CHECK(!emul_batches(&emul)); /* no such FIFO */
    write_reg(0x18, 0xE2);       /* I3C's bit is reserved */
    CHECK(emul_read(&emul, now, 0x6B, 0x0F, &(uint8_t){0}, 1) == -1);
}

static void check_strict_icm20948(void) {
    emul.kind = emul_kind("ICM-20948");
    power(1.0);
    CHECK(read_reg(0x06) == 0x41);
    write_reg(0x7F, 0x20);
    CHECK(read_reg(0x00) == 0 && read_reg(0x7F) == 0x20);
    write_reg(0x01, 0x3F); /* asleep */
    CHECK(read_reg(0x01) == 0x01);
    write_reg(0x7F, 0x00);
    CHECK(read_reg(0x00) == 0xEA);
    write_reg(0x06, 0x01);
    write_reg(0x14, 0x3F); /* of bank 2 */
    write_reg(0x7F, 0x20);
    CHECK(read_reg(0x14) == 0x01);
    write_reg(0x01, 0xFF); /* two bits are reserved */
    CHECK(read_reg(0x01) == 0x3F);
    write_reg(0x7F, 0x00);
    write_reg(0x11, 0x01);
    now += 2000;
    emul_advance(&emul, now);
    CHECK(!emul_int1(&emul)); /* no latch */
    write_reg(0x0F, 0x20);
    CHECK(emul_int1(&emul) && read_reg(0x1A) == 1 && read_reg(0x1A) == 0);
    write_reg(0x06, 0x80);
    CHECK((read_reg(0x06) & 0x80) != 0);
    now += 3000;
    CHECK(read_reg(0x06) == 0x41);
}

static void check_strict_bmi270(void) {
    size_t n;
    const uint8_t *file = emul_bmi270_file(&n);
    emul.kind = emul_kind("BMI270");
    power(1.0);
    write_reg(0x7C, 0x00);
    write_reg(0x59, 0x00); /* too soon after it */
    CHECK(read_reg(0x59) == 0x90);
    now += 450;
    write_reg(0x7D, 0x0E);
    now += 100000;
    CHECK((read_reg(0x03) & 0x40) == 0 && (read_reg(0x21) & 15) == 0); /* no file */
    write_reg(0x59, 0x00);
    for (size_t at = 0; at + 2 < n; at += 2) { /* all but its end */
        const uint8_t where[] = {(uint8_t)(at / 2 & 15), (uint8_t)(at / 32)};
        (void)emul_write(&emul, now, 0x68, 0x5B, where, 2);
        (void)emul_write(&emul, now, 0x68, 0x5E, file + at, 2);
    }
    write_reg(0x59, 0x01);
    now += 20000;
    CHECK((read_reg(0x21) & 15) == 2);
    gc_port_t without = port;
    gc_sensor_t imu;
    without.part_file = NULL;
    CHECK(gc_sensor_init(&imu, &gc_bmi270, &without, 0x68, &(gc_setup_t){.odr_hz = 100.0, .full_scale_dps = 250.0}) == GC_E_PART_FILE);
    refuse_writes_to = 0x5E;
    CHECK(gc_sensor_init(&imu, &gc_bmi270, &port, 0x68, &(gc_setup_t){.odr_hz = 100.0, .full_scale_dps = 250.0}) == GC_E_PART_FILE_REFUSED);
    refuse_writes_to = -1;
    CHECK(gc_sensor_init(&imu, &gc_bmi270, &port, 0x68, &(gc_setup_t){.odr_hz = 100.0, .full_scale_dps = 250.0}) == GC_OK);
    write_reg(0x69, 0x04);
    write_reg(0x7E, 0x02); /* the gyroscope runs */
    now += 300000;
    CHECK(read_reg(0x69) == 0 && read_reg(0x38) == 0x08 && read_reg(0x6E) == 0);
}

static uint8_t acc_reg(uint8_t reg) {
    uint8_t value = 0;
    (void)emul_read(&emul, now, 0x18, reg, &value, 1);
    return value;
}

static void set_acc_reg(uint8_t reg, uint8_t value) {
    (void)emul_write(&emul, now, 0x18, reg, &value, 1);
}

static void check_strict_bmi088(void) {
    emul.kind = emul_kind("BMI088");
    power(1.0);
    CHECK(read_reg(0x00) == 0x0F && acc_reg(0x00) == 0x1E);
    set_acc_reg(0x7D, 0x04); /* in suspend */
    CHECK(acc_reg(0x7D) == 0);
    set_acc_reg(0x7C, 0x00);
    set_acc_reg(0x7D, 0x04);
    set_acc_reg(0x41, 0x02); /* not on yet */
    CHECK(acc_reg(0x41) == 0x01);
    now += 450;
    set_acc_reg(0x41, 0x02);
    CHECK(acc_reg(0x41) == 0x02);
    write_reg(0x14, 0xB6);
    CHECK(emul_read(&emul, now, 0x68, 0x00, &(uint8_t){0}, 1) == -1 && acc_reg(0x00) == 0x1E);
    now += 30000;
    CHECK(read_reg(0x10) == 0x80);
    write_reg(0x16, 0x01);
    write_reg(0x15, 0x80);
    write_reg(0x18, 0x01);
    now += 600;
    emul_advance(&emul, now);
    const uint64_t tick = (uint64_t)emul_tick_us(&emul) + 1u;
    emul_advance(&emul, tick);
    CHECK(emul_int1(&emul));
    emul_advance(&emul, tick + 300);
    CHECK(!emul_int1(&emul)); /* its state shows for a short time */
    emul.address = 0x69; /* both address pins */
    CHECK(emul_is_at(&emul, 0x69) && emul_is_at(&emul, 0x19) && !emul_is_at(&emul, 0x18));
    emul.address = 0;
}

static void check_strict_lsm6dsv(void) {
    emul.kind = emul_kind("LSM6DSV");
    power(1.0);
    write_reg(0x11, 0x07);
    write_reg(0x12, 0x05); /* a reset while a sensor runs */
    now += 20000;
    CHECK((read_reg(0x12) & 1) == 1);
    power(1.0);
    write_reg(0x03, 0x01); /* I2C is off */
    CHECK(emul_read(&emul, now, 0x6B, 0x0F, &(uint8_t){0}, 1) == -1);
}

static uint8_t by(unsigned die, unsigned mode, uint32_t hz, const uint8_t *out, size_t n_out) {
    uint8_t value = 0;
    now += 70;
    emul_spi(&emul, now, die, mode, hz, out, n_out, &value, 1);
    return value;
}

/* Of a die that sends no dummy byte, and of one that does. */
static uint8_t id_by(unsigned die, unsigned mode, uint32_t hz, uint8_t reg) {
    return by(die, mode, hz, (const uint8_t[]){(uint8_t)(reg | 0x80)}, 1);
}

static uint8_t id_behind_dummy(unsigned die) {
    return by(die, 0, 10000000, (const uint8_t[]){0x80, 0}, 2);
}

static void send_by_spi(unsigned die, uint8_t reg, uint8_t value) {
    now += 70;
    emul_spi(&emul, now, die, 0, 1000000, (const uint8_t[]){reg, value}, 2, NULL, 0);
}

static void check_strict_spi(void) {
    emul.spi_faults = 0;
    emul.kind = emul_kind("BMI270");
    power(1.0);
    CHECK(id_behind_dummy(0) == 0xFF && id_behind_dummy(0) == 0x24); /* it starts as one of I2C */
    CHECK(id_by(0, 0, 10000000, 0x00) == 0xA5);                      /* the byte before the id */
    CHECK(by(0, 0, 10000000, (const uint8_t[]){0x00, 0}, 2) == 0xFF && emul.spi_faults == 1u); /* a writing that reads */
    send_by_spi(0, 0x7E, 0xB6);
    now += 3000;
    CHECK(id_behind_dummy(0) == 0xFF && id_behind_dummy(0) == 0x24);
    emul_brown_out(&emul);
    CHECK(id_behind_dummy(0) == 0xFF && id_behind_dummy(0) == 0x24 && emul.spi_faults == 1u);

    emul.kind = emul_kind("BMI088");
    power(1.0);
    CHECK(id_by(0, 3, 10000000, 0x00) == 0x0F);
    CHECK(id_behind_dummy(1) == 0xFF && id_behind_dummy(1) == 0x1E && id_by(1, 0, 10000000, 0x00) == 0xA5);
    CHECK(emul.spi_faults == 1u && id_by(2, 0, 10000000, 0x00) == 0xFF && emul.spi_faults == 2u);

    emul.kind = emul_kind("MPU-9250");
    power(1.0);
    CHECK(id_by(0, 3, 1000000, 0x75) == 0x71 && id_by(0, 0, 1000000, 0x75) == 0x71 && emul.spi_faults == 2u);
    CHECK(id_by(0, 1, 1000000, 0x75) == 0xFF && id_by(0, 2, 1000000, 0x75) == 0xFF && emul.spi_faults == 4u);
    CHECK(id_by(0, 3, 1000001, 0x75) == 0xFF && emul.spi_faults == 5u);
    CHECK(by(0, 3, 1000000, (const uint8_t[]){0xF5, 0}, 2) == 0x00 && emul.spi_faults == 5u); /* the register behind it */
    send_by_spi(0, 0x6A, 0x10);
    CHECK(emul_i2c_off(&emul) && id_by(0, 3, 1000000, 0x75) == 0x71);
    CHECK(emul_read(&emul, now, 0x68, 0x75, &(uint8_t){0}, 1) == -1);
    emul_set_faults(&emul, &(emul_faults_t){.nack = true});
    CHECK(id_by(0, 3, 1000000, 0x75) == 0xFF && emul.spi_faults == 5u);
    emul_set_faults(&emul, &(emul_faults_t){.nack = false});

    emul.kind = emul_kind("LSM6DSO");
    power(1.0);
    send_by_spi(0, 0x13, 0x04);
    CHECK(id_by(0, 3, 10000000, 0x0F) == 0x6C && emul_read(&emul, now, 0x6B, 0x0F, &(uint8_t){0}, 1) == -1);
    emul.kind = emul_kind("MPU-6050");
    power(1.0);
    CHECK(id_by(0, 3, 1, 0x75) == 0xFF && emul.spi_faults == 6u);
}

int main(void) {
    check_strict_mpu6050();
    check_strict_icm42688();
    check_strict_icm20948();
    check_strict_bmi270();
    check_strict_bmi088();
    check_strict_lsm6dsv();
    check_strict_older();
    check_strict_spi();
    return failures == 0 ? 0 : 1;
}
