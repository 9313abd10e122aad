"""What a file states in words above its table."""

import numpy as np
import pytest

from gyrocal.cli import main
from gyrocal.errors import InputError
from gyrocal.recording.importer import import_recording
from gyrocal.recording.session import Session
from gyrocal.recording.stated import rate_hz, unit_of_rates


@pytest.mark.parametrize(
    ("line", "rate"),
    [
        ("# sampling frequency: 40", 40), ("// Update Rate: 60.0Hz", 60), ("Sample Rate,128", 128), ("SampleRate: 1 kHz", 1000),
        ("# Sample rate (Hz): 50", 50), ("%odr=416", 416), ("sampling_rate_hz = 100", 100), ("offs = 3", None),
        ("Accelerometer sampling rate: 100", None), ("# rate 3", None), ("a sample of 5", None), ("", None),
    ],
)  # fmt: skip
def test_a_line_states_the_rate(line, rate):
    assert rate_hz(["of 2024", line]) == rate


def test_two_rates_are_none():
    assert rate_hz(["sample rate: 100", "update rate: 50"]) is None
    assert rate_hz(["sample rate: 100", "magnetometer sample rate: 50"]) == 100


@pytest.mark.parametrize(
    ("line", "unit"),
    [
        ("# units are seconds/meters/radians/a.u.", "rad/s"), ("# gyro in deg/s, accel in g", "dps"),
        ("Units: m/s^2, rad/s, uT", "rad/s"), ("angular velocity [rad/s]", "rad/s"), ("# gyroscope: mdps", "mdps"),
        ("units: degrees, radians", None), ("# Gyro range: 2000 dps", None), ("unit: m", None), ("deg/s", None),
    ],
)  # fmt: skip
def test_a_line_states_the_unit(line, unit):
    assert unit_of_rates([line]) == unit


def logged(path, above, rate_dps=0.0):
    """Two seconds at 50 Hz, without a time; its readings may be in either unit."""
    readings = rate_dps + np.random.default_rng(3).normal(0, 0.02, (100, 3))
    rows = [",".join(f"{value:.5f}" for value in row) for row in readings]
    path.write_text("\n".join([*above, "gyro_x,gyro_y,gyro_z", *rows]) + "\n")
    return path


def test_a_file_without_a_time_has_the_rate_that_it_states(tmp_path, capsys):
    log = logged(tmp_path / "a.csv", ["# sampling frequency: 50", "# gyro unit: rad/s"])
    assert main(["import", str(log), "-o", str(tmp_path / "s"), "--rate", "0", "--yes"]) == 0
    assert "states 50 Hz, which is taken" in " ".join("".join(capsys.readouterr()).split())
    session = Session.open(tmp_path / "s")
    assert session.sample_rate_hz == 50
    assert np.std(session.runs[0].gyro_dps) == pytest.approx(np.degrees(0.02), rel=0.2)


def test_a_file_that_states_nothing_asks_for_both(tmp_path):
    log = logged(tmp_path / "a.csv", ["# a log"])
    with pytest.raises(InputError, match="--rate-hz"):
        import_recording(log, tmp_path / "s", ["gz_dps=gyro_z:dps"], table_rate_dps=0.0)
    assert main(["import", str(log), "-o", str(tmp_path / "s"), "--rate", "0", "--rate-hz", "50", "--yes"]) != 0
