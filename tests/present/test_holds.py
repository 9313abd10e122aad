"""What ``info`` says of a file or a folder."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyrocal.cli import main
from gyrocal.error_model.accelerometer import AccelerometerModel
from gyrocal.error_model.model import Model
from gyrocal.error_model.term import Term
from gyrocal.present.holds import holds

T_S = np.arange(200) / 100


def test_a_folder_with_a_file_for_each_sensor_is_a_log(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    for name, level in (("Gyroscope", 0.0), ("Accelerometer", 5.66)):
        columns = {a: level + rng.normal(0, 0.01, T_S.size) for a in "xyz"}
        pl.DataFrame({"seconds_elapsed": T_S, **columns}).write_csv(tmp_path / f"{name}.csv")
    found = holds(tmp_path)
    assert (found["kind"], found["rows"]) == ("log", T_S.size)
    assert {"Gyroscope.x", "Accelerometer.z"} <= set(found["columns"])


def test_a_model_is_told_with_its_errors_and_its_accelerometer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    matrix, se = np.array([[1.006, 0, 0], [0.004, 0.993, 0], [-0.003, 0.002, 1.009]]), np.full((3, 3), 1e-4)
    acceleration = AccelerometerModel.of(matrix, se, np.array([0.012, -0.02, 0.031]), np.full(3, 5e-5), np.full(3, 0.002))
    terms = (Term("scale", "z", {"scale": 0.004}, {"scale": 0.0001}), Term("bias", "z", {"bias_dps": 0.3}))
    Model("mine", terms, accelerometer=acceleration).save(tmp_path / "m.toml")
    assert holds(tmp_path / "m.toml")["accelerometer"] == acceleration.to_json()
    assert main(["info", str(tmp_path / "m.toml")]) == 0
    out = capsys.readouterr().out
    for told in ("0.00400 ± 0.00010", "0.031000 ± 0.000050", "-0.00300 ± 0.00010"):
        assert told in out, out


def test_one_run_is_told_in_the_singular(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lab = tmp_path / "lab"
    lab.mkdir()
    rates = {f"g{a}_dps": np.random.default_rng(1).normal(0, 0.05, T_S.size) for a in "xyz"}
    pl.DataFrame({"t_s": T_S, **rates}).write_csv(lab / "a.csv")
    (lab / "session.toml").write_text(
        'format = "gyrocal-session/1"\nsample_rate_hz = 100.0\n[[run]]\nfile = "a.csv"\nface = "up"\ntable_rate_dps = 0.0\n'
    )
    assert main(["info", str(lab)]) == 0
    assert "a session of 1 run, axis z" in capsys.readouterr().out


def test_a_unit_that_nothing_decides_is_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pl.DataFrame({"time": T_S, "yaw_rate": 2 * np.sin(9 * T_S)}).write_csv(tmp_path / "arm.csv")
    assert main(["info", str(tmp_path / "arm.csv")]) == 0
    out = capsys.readouterr().out
    assert "gz_dps=yaw_rate" in out
    assert "the unit of yaw_rate is not known" in out
    assert holds(tmp_path / "arm.csv")["unknown"] in out.replace("\n", " ")
