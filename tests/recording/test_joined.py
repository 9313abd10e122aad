"""Recordings of one file a sensor: joined on time, at rates and moments of their own."""

import json
from pathlib import Path

import numpy as np
import pytest

from gyrocal.cli import main
from gyrocal.errors import InputError
from gyrocal.recording.import_options import Options
from gyrocal.recording.importer import read_recording
from gyrocal.recording.session import Session

RNG = np.random.default_rng(2)
T_S = np.arange(2000) / 100
SLOW_S = 0.0123 + np.arange(930) / 50
TILT = np.radians(40) * np.sin(2 * np.pi * 0.4 * T_S)
RATE_RAD_S = np.radians(40) * 2 * np.pi * 0.4 * np.cos(2 * np.pi * 0.4 * T_S)
"""The phone swings about x."""


def gravity(t_s: np.ndarray) -> np.ndarray:
    tilt = np.radians(40) * np.sin(2 * np.pi * 0.4 * t_s)
    return 9.81 * np.column_stack([0 * t_s, np.sin(tilt), np.cos(tilt)])


def write(path: Path, head: str, *columns: np.ndarray) -> None:
    np.savetxt(path, np.column_stack(columns), "%.7f", ",", header=head, comments="")


def phone(folder: Path, prefix: str = "", start_s: float = 0.0) -> None:
    folder.mkdir(exist_ok=True)
    gyro = np.column_stack([RATE_RAD_S, 0 * T_S, 0 * T_S]) + RNG.normal(0, 0.002, (T_S.size, 3))
    acc = gravity(SLOW_S) + RNG.normal(0, 0.03, (SLOW_S.size, 3))
    head = "seconds_elapsed,z,y,x"
    write(folder / f"{prefix}Gyroscope.csv", head, start_s + T_S, gyro[:, ::-1])
    write(folder / f"{prefix}TotalAcceleration.csv", head, start_s + SLOW_S, acc[:, ::-1])
    write(folder / f"{prefix}Accelerometer.csv", head, start_s + SLOW_S, (acc - gravity(SLOW_S))[:, ::-1])
    write(folder / f"{prefix}Magnetometer.csv", head, start_s + SLOW_S, acc)
    (folder / "Metadata.csv").write_text("version,device name\n3,phone\n")


def test_a_folder_of_a_phone_is_one_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    phone(tmp_path / "phone")
    out = tmp_path / "out"
    assert main(["import", str(tmp_path / "phone"), str(out), "--gravity", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert "gx_dps=Gyroscope.x:rad/s" in found["guessed"]
    assert "ay_g=TotalAcceleration.y:m/s2" in found["guessed"]
    run = Session.open(out).runs[0]
    assert len(Session.open(out).runs) == 1
    assert run.gyro_dps[:, 0] == pytest.approx(np.degrees(RATE_RAD_S), abs=1.0)
    known = np.isfinite(run.acc_g).all(axis=1)
    assert known.sum() == pytest.approx(np.sum(np.clip(T_S, SLOW_S[0], SLOW_S[-1]) == T_S), abs=2)
    assert run.acc_g[known] == pytest.approx(gravity(T_S[known]) / 9.80665, abs=0.03)


def test_numbers_of_the_sensors_are_no_other_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    phone(tmp_path / "phone")
    (tmp_path / "phone" / "Gyroscope.csv").rename(tmp_path / "phone" / "gyroscope_2.csv")
    (tmp_path / "phone" / "TotalAcceleration.csv").rename(tmp_path / "phone" / "accelerometer_1.csv")
    (tmp_path / "phone" / "Accelerometer.csv").unlink()
    assert main(["import", str(tmp_path / "phone"), str(tmp_path / "out"), "--gravity", "--json"]) == 0
    assert "ay_g=accelerometer_1.y:m/s2" in json.loads(capsys.readouterr().out)["guessed"]


def test_numbers_of_recordings_are_kept_apart(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for number in (1, 2):
        phone(tmp_path / "phone", f"{number}_")
        for name in ("Gyroscope", "TotalAcceleration"):
            (tmp_path / "phone" / f"{number}_{name}.csv").rename(tmp_path / "phone" / f"{name}_{number}.csv")
        (tmp_path / "phone" / f"{number}_Accelerometer.csv").unlink()
    assert main(["import", str(tmp_path / "phone"), str(tmp_path / "out"), "--gravity", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["runs"] == 2
    for run in Session.open(tmp_path / "out").runs:
        assert np.isfinite(run.acc_g).all(axis=1).mean() > 0.9


def test_two_recordings_in_a_folder_are_two_runs(tmp_path: Path) -> None:
    for prefix in ("a_", "b_"):
        phone(tmp_path / "phone", prefix)
    found = read_recording(tmp_path / "phone", Options(gravity=True))
    assert [run.file for run in found.session.runs] == ["a_Gyroscope.csv", "b_Gyroscope.csv"]


def test_a_file_that_is_named_is_joined(tmp_path: Path) -> None:
    phone(tmp_path / "phone", start_s=100.0)
    gyroscope, other = tmp_path / "phone" / "Gyroscope.csv", tmp_path / "phone" / "TotalAcceleration.csv"
    run = read_recording(gyroscope, Options(gravity=True, joined=[other])).session.runs[0]
    known = np.isfinite(run.acc_g).all(axis=1)
    assert run.acc_g[known] == pytest.approx(gravity(T_S[known]) / 9.80665, abs=0.03)
    elsewhere = tmp_path / "later.csv"
    write(elsewhere, "time,ax,ay,az", SLOW_S + 500, gravity(SLOW_S))
    with pytest.raises(InputError, match=r"later.csv: its times do not overlap with those of the gyroscope"):
        read_recording(gyroscope, Options(gravity=True, joined=[elsewhere]))


def without_headers(folder: Path) -> list[str]:
    """A phone's two files without their headers, and the options that name the columns of the first."""
    phone(folder)
    for name in ("Gyroscope", "TotalAcceleration"):
        file = folder / f"{name}.csv"
        file.write_text(file.read_text().partition("\n")[2])
    return ["import", str(folder / "Gyroscope.csv"), str(folder / "out"), "--gravity", "--columns", "time,gz,gy,gx", "--json"]


def test_a_joined_file_without_a_header_is_told_what_it_needs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """``--columns`` names those of the gyroscope's file, and was advised though it was given."""
    args = without_headers(tmp_path)
    assert main([*args, "--join", str(tmp_path / "TotalAcceleration.csv")]) == 2
    told = capsys.readouterr().err
    assert "TotalAcceleration.csv: no header" in told
    assert "behind the file: --join FILE:time,ax,ay,az" in told
    assert "--columns" not in told


def test_the_columns_of_a_joined_file_stand_behind_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    args = without_headers(tmp_path)
    assert main([*args, "--join", f"{tmp_path / 'TotalAcceleration.csv'}:time, az,ay,ax"]) == 0
    assert "ay_g=TotalAcceleration.ay:m/s2" in json.loads(capsys.readouterr().out)["guessed"]
    run = Session.open(tmp_path / "out").runs[0]
    known = np.isfinite(run.acc_g).all(axis=1)
    assert run.acc_g[known] == pytest.approx(gravity(T_S[known]) / 9.80665, abs=0.03)


def test_a_colon_in_the_name_of_a_joined_file_is_of_the_name(tmp_path: Path) -> None:
    folder = tmp_path / "14:30, desk"
    phone(folder)
    options = Options(gravity=True, joined=[folder / "TotalAcceleration.csv"])
    run = read_recording(folder / "Gyroscope.csv", options).session.runs[0]
    assert np.isfinite(run.acc_g).all(axis=1).mean() > 0.9
