"""Sensors of other kinds on the simulated board: they are found by their ids, and calibrate as the LSM6DSO does."""

import numpy as np
import pytest

from gyrocal.device.wire import raw_table

from .conftest import BY_SPI, DOWN, UP, WIRED, Play, sentences, turn, values

RUNS = [*turn(0, UP), "1 > start up", "7.5 > stop", *turn(8, DOWN), "8.5 > start down", "15 > stop"]


def test_sensors_of_different_makers_calibrate_side_by_side(play: Play) -> None:
    text = play(["0 chip 0 MPU-6050", "0 chip 1", "0 chip 2 ICM-42688-P", "0 chip 3 LSM6DSR", *RUNS], 16)
    assert not sentences(text, "ERR")
    names = {s.imu: s.fields["sensor"] for s in sentences(text, "HEL")}
    assert names == {0: "MPU-6050", 1: "LSM6DSO", 2: "ICM-42688-P", 3: "LSM6DSR"}
    for imu in range(4):
        answer = next(s for s in sentences(text, "CAL", imu) if s.fields["method"] == "baseline" and s.real("seconds") == 6.0)
        scale, scale_se = answer.real("scale"), answer.real("scale_se")
        assert scale == pytest.approx((UP[imu] - DOWN[imu]) * 0.00875 / 156 - 1, abs=5 * (scale_se or 0))
        assert answer.fields["temp_c"].startswith("2")


@pytest.mark.parametrize(
    ("name", "rate_hz"), [("MPU-6050", 100), ("MPU-9250", 200), ("ICM-42688-P", 100), ("LSM6DS3TR-C", 104)]
)
def test_the_interrupt_line_of_each_maker_dates_samples(play: Play, name: str, rate_hz: float) -> None:
    script = [f"0 chip 0 {name}", *turn(0, UP), f"1 > set rate_hz {rate_hz}", "2 > stream raw", "4 > status"]
    text = play(script, 5, None, WIRED)
    true_hz = 6667 / 64 if rate_hz == 104 else rate_hz
    assert np.abs(np.diff(raw_table(sentences(text)).t_us) - 1e6 / true_hz).max() < 10
    assert (values(text, "STA", "stale"), values(text, "STA", "missed")) == (["0"], ["0"])
    assert not sentences(text, "ERR")


def test_of_two_sensors_at_one_place_the_first_is_used_and_the_other_told(play: Play) -> None:
    text = play(["0 chip 0", "0 chip 1 MPU-6500", *turn(0, UP), "1 > status"], 2)
    assert {s.imu: s.fields["sensor"] for s in sentences(text, "HEL")} == {0: "LSM6DSO", 1: "MPU-6500"}
    assert "is not used" not in text


def test_a_sensor_of_another_maker_may_come_later(play: Play) -> None:
    """The board has stood in for the sensor at 0x6B, and this one is at 0x68."""
    text = play(["2 chip 0 MPU-6050"], 6)
    assert text.count("# sensor 0 answers now: the board restarts\n") == 1
    text = play(["0 chip 1", "3 chip 0 MPU-6050", *turn(0, UP), "6 > status"], 7)
    assert {s.imu for s in sentences(text, "STA")} == {0, 1}


def test_a_sensor_that_answers_with_an_unknown_id_is_told(play: Play) -> None:
    text = play(["0 chip 0", *turn(0, UP), "1 > set sensor LSM6DSR", "3 > set sensor auto", "5 > get sensor"], 6)
    assert "wrong_id" in values(text, "ERR", "name")
    assert [s.fields["sensor"] for s in sentences(text, "HEL")] == ["LSM6DSO", "LSM6DSR", "LSM6DSO"]
    assert sentences(text, "ACK")[-1].fields["sensor"] == "auto"
    assert not [s for s in sentences(text, "ERR") if s.t_us > 3_200_000]


@pytest.mark.parametrize(("name", "rate_hz"), [("LSM6DSO", 104), ("MPU-9250", 200), ("ICM-42688-P", 200), ("BMI088", 400)])
def test_a_sensor_by_spi(play: Play, name: str, rate_hz: float) -> None:
    script = [f"0 chip 0 {name}", *RUNS, f"15.5 > set rate_hz {rate_hz}", "16 > stream raw", "17 > stream off", "17.5 > status"]
    text = play(script, 18, None, *BY_SPI, WIRED)
    assert not sentences(text, "ERR")
    assert {s.imu: s.fields["sensor"] for s in sentences(text, "HEL")} == {0: name}
    answer = next(s for s in sentences(text, "CAL") if s.fields["method"] == "baseline" and s.real("seconds") == 6.0)
    assert answer.real("scale") == pytest.approx((UP[0] - DOWN[0]) * 0.00875 / 156 - 1, abs=5 * (answer.real("scale_se") or 0))
    true_hz = 6667 / 64 if rate_hz == 104 else rate_hz
    times_us = raw_table(sentences(text)).t_us
    assert np.diff(times_us).mean() == pytest.approx(1e6 / true_hz, rel=2e-3)
    assert [s.fields["missed"] for s in sentences(text, "RUN") if s.fields["state"] == "end"] == ["0", "0"]
    assert set(values(text, "STA", "resets")) == {"0"}


def test_a_sensor_by_spi_that_comes_later_or_has_none(play: Play) -> None:
    text = play(["3 chip 0 ICM-42688-P", *turn(0, UP), "6 > status"], 7, None, *BY_SPI)
    assert values(text, "ERR", "name")[0] == "bus_nack"
    assert sentences(text, "HEL")[-1].fields["sensor"] == "ICM-42688-P"
    assert values(text, "STA", "waits") == ["start"]
    text = play(["0 chip 0 MPU-6500", *turn(0, UP), "1 > set sensor MPU-6050", "2 > get sensor"], 3, None, *BY_SPI)
    assert values(text, "ERR", "name") == ["no_spi"]
    assert sentences(text, "ACK")[-1].fields["sensor"] == "auto"
