"""Calibration without a table: planted truths, imu_tk's method on the same data, and sessions that cannot be calibrated."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from by_hand import lower_triangular, matrix_of, session_of, truth_of, turned_by
from gyrocal.cli import main
from gyrocal.errors import InputError
from gyrocal.gravity.calibrate import Calibration, calibrate
from gyrocal.gravity.compare import compare
from gyrocal.gravity.rests import find
from gyrocal.recording.session import AXES, Session
from gyrocal.simulation.simulate import simulate

SEEDS = (0, 1, 2)
Parts = list[tuple[Session, dict[str, Any], Calibration]]


def imu_tk(session: Session) -> np.ndarray:
    """The gyroscope's matrix of readings by the method of imu_tk (Tedaldi et al. 2014) on the same rests.

    Unweighted: the accelerometer by the size of the means, the bias from the first rest, then scale and misalignment that make
    each integrated movement end where gravity is. Its frame is turned into the one whose x axis the accelerometer keeps.
    """
    found, run = find(session), session.runs[0]
    means = np.array([r.acc_g for r in found.rests])

    def upper(p: np.ndarray) -> np.ndarray:
        return np.array([[1, -p[0], p[1]], [0, 1, -p[2]], [0, 0, 1]]) @ np.diag(p[3:6])

    acc = least_squares(
        lambda p: np.linalg.norm((means - p[6:]) @ upper(p).T, axis=1) ** 2 - 1, [0, 0, 0, 1, 1, 1, 0, 0, 0], x_scale=0.01
    ).x
    up = (means - acc[6:]) @ upper(acc).T
    up /= np.linalg.norm(up, axis=1)[:, None]
    bias_dps = run.gyro_dps[found.rests[0].start : found.rests[0].stop].mean(axis=0)

    def full(p: np.ndarray) -> np.ndarray:
        return np.array([[1, -p[0], p[1]], [p[2], 1, -p[3]], [-p[4], p[5], 1]]) @ np.diag(p[6:])

    parts = [(m, np.deg2rad(run.gyro_dps[m.start : m.stop] - bias_dps), run.t_s[m.start : m.stop]) for m in found.movements]
    longest = max(len(w) for _, w, _ in parts)

    def residual(p: np.ndarray) -> np.ndarray:
        correct = full(p)
        padded = np.zeros((longest - 1, len(parts), 3))
        for k, (_, w, t) in enumerate(parts):
            padded[: len(w) - 1, k] = (w[1:] + w[:-1]) / 2 @ correct.T * np.diff(t)[:, None]
        turned = Rotation.identity(len(parts))
        for step in padded:
            turned = turned * Rotation.from_rotvec(step)
        return (turned.inv().apply(up[[m.before for m, _, _ in parts]]) - up[[m.after for m, _, _ in parts]]).ravel()

    gyro = least_squares(residual, [0, 0, 0, 0, 0, 0, 1, 1, 1], x_scale=0.01).x
    _, turn = lower_triangular(np.linalg.inv(upper(acc)))
    return np.asarray(np.linalg.inv(full(gyro)) @ turn.T)


@pytest.fixture(scope="module")
def parts() -> Parts:
    made = [simulate(campaign="hands", seed=seed) for seed in SEEDS]
    return [(session, truth, calibrate(session)) for session, truth in made]


def test_scale_bias_and_misalignment_are_found_with_their_errors(parts: Parts) -> None:
    z = []
    for _, truth, found in parts:
        matrix, se = matrix_of(found)
        error = matrix - truth_of(truth)
        assert np.abs(np.diag(error)).max() < 0.003
        assert np.abs(error - np.diag(np.diag(error))).max() < 0.004
        z += list((error / se).ravel())
        z += [(e.bias_dps - b) / e.bias_se_dps for e, b in zip(found.estimates, truth["runs"][0]["bias_dps"], strict=True)]
        assert all(e.trusted for e in found.estimates)
    assert 0.75 < np.sqrt(np.mean(np.square(z))) < 1.3  # 36 values
    assert np.abs(z).max() < 5


def test_the_accelerometer_is_found_with_its_errors(parts: Parts) -> None:
    z = []
    for _, truth, found in parts:
        told = found.to_json()["accelerometer"]
        se = np.array(told["matrix_se"])
        error = np.array(told["matrix"]) - np.array(truth["accelerometer"]["matrix"])
        assert np.abs(error).max() < 0.002
        z += list(error[se > 0] / se[se > 0])
        bias_g, planted_g = np.array(list(told["bias_g"].values())), np.array(truth["accelerometer"]["bias_g"])
        z += list((bias_g - planted_g) / np.array(list(told["bias_se_g"].values())))
    assert 0.7 < np.sqrt(np.mean(np.square(z))) < 1.35


def test_errors_are_at_most_those_of_imu_tks_method(parts: Parts) -> None:
    ours, theirs = [], []
    for session, truth, found in parts:
        ours.append(matrix_of(found)[0] - truth_of(truth))
        theirs.append(imu_tk(session) - truth_of(truth))
    assert np.sqrt(np.mean(np.square(ours))) <= np.sqrt(np.mean(np.square(theirs)))


def test_the_budget_adds_up_to_the_standard_error(parts: Parts) -> None:
    _, _, found = parts[0]
    told = found.to_json()
    for e in found.estimates:
        rows = [row for row in told["budget"] if row["axis"] == e.axis]
        assert np.sqrt(sum(row["scale_se"] ** 2 for row in rows)) == pytest.approx(e.scale_se, rel=0.02)
        assert np.sqrt(sum(row["bias_se_dps"] ** 2 for row in rows)) == pytest.approx(e.bias_se_dps, rel=0.02)
        assert all(row["advice"].startswith("nothing") == (row["scale_se"] == 0) for row in rows if row["cause"] == "misfit")


def turned_about(axes: list[int], seed: int = 0) -> Session:
    """Turns of 90 deg about some axes of the sensor, z up at first, with rests in between."""
    rng = np.random.default_rng(seed)
    rotation = Rotation.identity()
    rates, ups = [], []
    for axis in axes:
        phase = np.linspace(0, 1, 101)[1:]
        w = np.zeros((100, 3))
        w[:, axis] = 90 * (1 - np.cos(2 * np.pi * (phase - 0.005)))
        rates += [np.zeros((200, 3)), w]
        ups.append(np.tile(rotation.inv().apply([0, 0, 1]), (200, 1)))
        way = rotation * Rotation.from_rotvec(np.deg2rad(np.cumsum(w, axis=0) / 100))
        ups.append(way.inv().apply([0, 0, 1]))
        rotation = way[-1]
    rates.append(np.zeros((200, 3)))
    ups.append(np.tile(rotation.inv().apply([0, 0, 1]), (200, 1)))
    w, up = np.vstack(rates), np.vstack(ups)
    y = w + rng.normal(0, 0.05, w.shape)
    a = up + rng.normal(0, 0.002, w.shape)
    return session_of(pl.DataFrame({
        "t_s": np.arange(len(w)) / 100, **{f"g{n}_dps": y[:, i] for i, n in enumerate(AXES)},
        **{f"a{n}_g": a[:, i] for i, n in enumerate(AXES)},
    }))  # fmt: skip


def test_an_axis_that_was_not_turned_has_no_scale_and_says_how_to_get_it() -> None:
    found = calibrate(turned_about([0, 0, 0, 0, 0, 0, 0, 0]))
    scale = {e.axis: e.scale for e in found.estimates}
    assert scale["x"] is not None
    assert scale["y"] is None
    assert scale["z"] is None
    told = {w.axis: w.text for w in found.warnings if w.code == "no_answer"}
    assert set(told) == {"y", "z"}
    assert "turn the sensor about it" in told["y"]
    assert all(e.bias_dps is not None and abs(e.bias_dps) < 0.02 for e in found.estimates)


def test_rotation_about_gravity_is_not_seen() -> None:
    found = calibrate(turned_about([*[0] * 4, 2, 2, *[1] * 4, 2, 2]))  # z turns only where it is upright
    scale = {e.axis: e.scale for e in found.estimates}
    assert scale["z"] is None
    assert scale["x"] == pytest.approx(0.0, abs=0.005)
    assert scale["y"] == pytest.approx(0.0, abs=0.005)


def test_too_few_rests_are_told(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    session, _ = simulate(campaign="hands", scenarios=3)
    with pytest.raises(InputError, match="3 rests found, and 4 are needed"):
        calibrate(session)
    session.save(tmp_path / "s")
    assert main(["calibrate", str(tmp_path / "s")]) == 2
    assert "rests found" in capsys.readouterr().err


def test_seconds_that_hold_too_few_rests_are_told_beside_those_that_answer(parts: Parts) -> None:
    session, _, whole = parts[0]
    both = calibrate(session, [3.0, None])
    assert [e.scale for e in both.estimates] == [e.scale for e in whole.estimates]
    (told,) = [w for w in both.warnings if w.code == "no_answer" and w.axis is None]
    assert told.text.startswith("nothing from the first 3 s: ")
    with pytest.raises(InputError, match="rest"):
        calibrate(session, [3.0, 4.0])


def test_readings_in_rad_s_are_refused_with_what_to_do(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    session, _ = simulate(campaign="hands", scenarios=8)
    run = session.runs[0]
    frame = run.table.with_columns(pl.col("gx_dps", "gy_dps", "gz_dps") * np.pi / 180)
    session.with_runs([replace(run, frame=frame)]).save(tmp_path / "s")
    assert main(["calibrate", str(tmp_path / "s")]) == 2
    assert "If its readings are in rad/s, give the unit when importing" in capsys.readouterr().err


def test_rests_that_moved_are_left_out_and_told() -> None:
    session, truth = simulate(campaign="hands", seed=5)
    run = session.runs[0]
    rests = find(session).rests
    slow = np.zeros(len(run))
    for rest in rests[3:6]:
        slow[rest.start - 20 : rest.stop + 20] = 4.0
    frame = run.table.with_columns(pl.Series("gx_dps", run.gyro_dps[:, 0] + slow))
    found = calibrate(session.with_runs([replace(run, frame=frame)]))
    (told,) = [w for w in found.warnings if w.code == "not_at_rest"]
    assert "3 quiet stretches moved" in told.text
    error = matrix_of(found)[0] - truth_of(truth)
    assert np.abs(error).max() < 0.003


@pytest.mark.parametrize("factor", [0.7, 1.4, *(pytest.param(factor, marks=pytest.mark.wide) for factor in (0.5, 2.0))])
def test_rates_of_a_wrong_range_are_told_by_their_factor(factor: float) -> None:
    """Half the range that was set was said to scatter by hundreds of times the noise, whatever the cause."""
    session = turned_by([("z", 90), ("y", 120), ("x", 90), ("y", -75), ("z", -60), ("x", -110), ("y", 90), ("z", 100)])
    assert not compare(session).warnings
    table = session.runs[0].frame.with_columns(pl.col(f"g{a}_dps") * factor for a in AXES)
    (told,) = [w for w in compare(session_of(table)).warnings if w.code == "scale_implausible"]
    assert told.blocking
    assert f"the gyroscope turns by {factor:.2g} of the angles by which gravity turns" in told.text
    overruled = compare(session_of(table, accept=("scale_implausible",))).warnings
    assert not any(w.blocking for w in overruled)


def test_beside_readings_that_no_rates_explain_every_figure_is_finite() -> None:
    """Full steps of the fit let the scales grow until a matrix was singular."""
    table, rng = turned_about([0, 1, 2, 0, 1, 2, 0, 1], 2).runs[0].table, np.random.default_rng(2)
    moving = np.abs(table.select("gx_dps", "gy_dps", "gz_dps").to_numpy()).max(axis=1) > 1
    wild = {}
    for a in AXES:
        course_dps = np.clip(rng.normal(0, 300, moving.size).cumsum() / 5, -250, 250)
        wild[f"g{a}_dps"] = pl.Series(np.where(moving, course_dps, table[f"g{a}_dps"].to_numpy()))
    found = compare(session_of(table.with_columns(**wild)))
    assert all(np.isfinite(w) for axis in found.to_json()["per_axis"].values() for w in axis.values() if isinstance(w, float))


def test_other_methods_and_true_rates_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session, _ = simulate(tmp_path / "s", "hands", scenarios=6)
    assert main(["calibrate", str(tmp_path / "s"), "--method", "cnn"]) == 2
    assert "use --method model" in capsys.readouterr().err
    header = (tmp_path / "s/session.toml").read_text()
    (tmp_path / "s/session.toml").write_text(header.replace('face = "up"', 'face = "up", table_rate_dps = 78.0'))
    assert main(["calibrate", str(tmp_path / "s")]) == 2
    assert "a true rate is given too" in capsys.readouterr().err
    with pytest.raises(InputError, match="reference is gravity"):
        _ = session.runs[0].rate_dps


def test_the_command_prints_json_with_the_contracts_keys(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    simulate(tmp_path / "s", "hands", seed=1, scenarios=12)
    assert main(["calibrate", str(tmp_path / "s"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [e["axis"] for e in told["estimates"]] == list(AXES)
    keys = {"scenario", "method", "seconds", "scale", "scale_se", "bias_dps", "bias_se_dps", "misfit", "flags", "trusted"}
    assert keys <= set(told["estimates"][0])
    assert main(["calibrate", str(tmp_path / "s")]) == 0
    assert "Where the error comes from" in capsys.readouterr().out
