"""The accelerometer of a session by hand: against planted truth, own least squares and a factory's values, told and applied."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from scipy.optimize import least_squares

from by_hand import session_of
from gyrocal.api import Model, Session, add
from gyrocal.cli import main
from gyrocal.error_model.accelerometer import ACCELERATIONS
from gyrocal.gravity.rests import find
from gyrocal.gravity.scene import Scene
from gyrocal.recording.session import AXES
from gyrocal.simulation.simulate import simulate
from real_recordings import recording


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> tuple[Session, dict[str, Any]]:
    return simulate(tmp_path_factory.mktemp("hand") / "first", "hands", (), 1, scenarios=24)


@pytest.fixture(scope="module")
def model(first: tuple[Session, dict[str, Any]]) -> Model:
    return add(first[0], Model.open("default"), "misalignment").after.fit.model


def own_least_squares(means_g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The lower triangular matrix and the bias of readings, by which every rest's mean has the size 1 g."""

    def parts(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        matrix = np.zeros((3, 3))
        matrix[np.tril_indices(3)] = p[:6]
        return matrix, p[6:]

    def off(p: np.ndarray) -> np.ndarray:
        matrix, bias = parts(p)
        return np.linalg.norm(np.linalg.solve(matrix, (means_g - bias).T), axis=0) - 1

    return parts(least_squares(off, [1, 0, 1, 0, 0, 1, 0, 0, 0], x_scale=0.01).x)


def test_it_is_that_of_own_least_squares_within_a_fraction_of_its_errors(first: tuple[Session, dict[str, Any]]) -> None:
    found = Scene.of(first[0]).accelerometer_model
    matrix, bias_g = own_least_squares(np.array([r.acc_g for r in find(first[0]).rests]))
    free = np.tril_indices(3)
    assert (np.abs(np.array(found.matrix) - matrix)[free] < np.array(found.matrix_se)[free]).all()
    assert (np.abs(np.array(found.bias_g) - bias_g) < found.bias_se_g).all()


def test_the_model_of_a_session_holds_it(first: tuple[Session, dict[str, Any]], model: Model, tmp_path: Path) -> None:
    planted = first[1]["accelerometer"]
    acc = model.accelerometer
    assert acc is not None
    off = np.array(acc.matrix) - planted["matrix"]
    free = np.tril_indices(3)
    z = [*(off / np.maximum(acc.matrix_se, 1e-12))[free], *((np.array(acc.bias_g) - planted["bias_g"]) / acc.bias_se_g)]
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.8, "nine values, which the errors explain"
    model.save(tmp_path / "m.toml")
    assert Model.open(tmp_path / "m.toml").accelerometer == acc


def test_rests_that_it_was_not_fitted_to_are_corrected(
    first: tuple[Session, dict[str, Any]], model: Model, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (run,) = first[0].runs
    until_s = 0.65 * run.duration_s
    early = run.first(until_s)
    assert early is not None
    half = replace(model, accelerometer=Scene.of(first[0].with_runs([early])).accelerometer_model)
    half.save(tmp_path / "m.toml")
    words = ["apply", str(first[0].path), "--model", str(tmp_path / "m.toml"), "-o", str(tmp_path / "out")]
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["accelerometer"] is True
    done = Session.open(tmp_path / "out").runs[0]
    late = [r for r in find(first[0]).rests if run.sample_s[r.start] > until_s]
    assert len(late) > 4
    raw, corrected = (
        np.array([np.linalg.norm(np.mean(of.acc_g[r.start : r.stop], axis=0)) - 1 for r in late]) for of in (run, done)
    )
    assert np.abs(raw).max() > 0.02
    assert np.sqrt(np.mean(corrected**2)) < 0.001
    written = done.table.select(ACCELERATIONS).to_numpy()  # with as many digits as a session's tables have
    assert half.correct(run.table).select(ACCELERATIONS).to_numpy() == pytest.approx(written, abs=1e-6)


def test_calibrate_and_compare_tell_it(first: tuple[Session, dict[str, Any]], capsys: pytest.CaptureFixture[str]) -> None:
    folder = str(first[0].path)
    for verb in ("calibrate", "compare"):
        assert main([verb, folder, "--json"]) == 0
        told = json.loads(capsys.readouterr().out)["accelerometer"]
        assert set(told["scale"]) == set(told["bias_g"]) == set(told["bias_se_g"]) == set(AXES)
        assert all(se > 0 for se in told["scale_se"].values())
    assert main(["calibrate", folder]) == 0
    out = capsys.readouterr().out
    assert "Accelerometer" in out
    assert "reads of another axis" in out


def test_the_mti_s_accelerometer_is_that_of_its_factory() -> None:
    """The factory gives 415, 413 and 415 counts per m/s^2, and the offsets that are subtracted here."""
    frame = pl.read_csv(recording("xsens_mti_multipose_imutk", "xsens_raw.csv.gz"))
    gyro, acc = (np.column_stack([frame[f"{name}_{a}_cnt"].to_numpy() for a in AXES]).astype(float) for name in ("gyr", "acc"))
    gyro_dps, acc_g = np.rad2deg((gyro - [32768, 32466, 32485]) / 4767), (acc - [33123, 33276, 32360]) / (415 * 9.80665)
    columns = {f"g{n}_dps": gyro_dps[:, i] for i, n in enumerate(AXES)} | {f"a{n}_g": acc_g[:, i] for i, n in enumerate(AXES)}
    session = session_of(pl.DataFrame({"t_s": frame["t_s"].to_numpy(), **columns}))
    found = Scene.of(session).accelerometer_model
    assert np.diag(np.array(found.matrix)) == pytest.approx(np.array([415, 413, 415]) / 415, abs=0.004)
    assert np.abs(found.bias_g).max() < 0.02
    assert np.max(found.matrix_se) < 0.001
