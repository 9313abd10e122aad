"""Sensors of other kinds: what their simulated devices say is recorded, and calibrates as the session that they measured."""

from pathlib import Path

import numpy as np
import pytest

from gyrocal.cli import main
from gyrocal.device.port import Link
from gyrocal.device.record import Recorder
from gyrocal.device.simulated import SimulatedDevice, replay, simulated_scenario
from gyrocal.device.simulator import part_names
from gyrocal.errors import InputError
from gyrocal.recording.session import Session

LSB_DPS = {"LSM6DSR": 0.00875, "MPU-6050": 1 / 131, "ICM-42688-P": 1 / 131}


@pytest.mark.parametrize(("part", "bus"), [*((part, "i2c") for part in LSB_DPS), ("ICM-42688-P", "spi")])
def test_a_recording_of_each_family_is_the_session_that_it_measured(part: str, bus: str, tmp_path: Path) -> None:
    session = simulated_scenario([], 0)
    with SimulatedDevice(session, part=part, bus=bus) as simulated, Link(simulated.port) as link:
        report = Recorder(link, tmp_path / "out", wanted=None).record()
    assert (report.lost_sentences, report.bad_sentences, report.errors) == (0, 0, [])
    recorded = Session.open(tmp_path / "out")
    assert recorded.sensor == part
    assert recorded.lsb_dps == pytest.approx(LSB_DPS[part], rel=1e-8)
    for before, after in zip(session.runs, recorded.runs, strict=True):
        assert np.array_equal(before.t_us - before.t_us[0], after.t_us - after.t_us[0])
        off_dps = np.abs(after.gyro_dps - before.gyro_dps)
        assert off_dps.max() < 0.51 * (LSB_DPS[part] + 2 * 0.00875)  # the rows carry a rounding error on
        off_dps = np.abs(after.gyro_dps.mean(axis=0) - before.gyro_dps.mean(axis=0))
        assert off_dps.max() < LSB_DPS[part] / 8  # few counts lie within the noise, each with its own rounding
        assert before.temp_c is not None
        assert after.temp_c is not None
        assert np.abs(after.temp_c - before.temp_c).max() < 0.01


def test_the_kinds_are_listed_and_others_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert part_names()[:3] == ["LSM6DSO", "LSM6DSOX", "LSM6DSO32"]
    for options, reason in (
        (["MPU6050"], "want one of LSM6DSO, "), (["MPU-6050", "--fifo", "8"], "leave --fifo out"),
        (["MPU-6050", "--bus", "spi"], "does not speak SPI"), (["MPU-6500", "--bus", "qspi"], "want i2c or spi"),
    ):  # fmt: skip
        assert main(["device", "--part", *options]) == 2
        line = capsys.readouterr().err
        assert reason in line
        assert line.count("\n") == 1


def test_a_rate_or_range_that_a_part_lacks_is_told() -> None:
    session = simulated_scenario([], 0)
    for part, rate_hz in (("MPU-6050", 1200.0), ("ICM-42688-P", 900.0)):
        faster = Session(**{**vars(session), "sample_rate_hz": rate_hz})
        with pytest.raises(InputError, match="does not measure at sample_rate_hz"):
            replay(faster, part=part)
