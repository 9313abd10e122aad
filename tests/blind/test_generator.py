"""The sensor chain against physics: files, chip, noise, vectors fixed in the room, temperature."""

from __future__ import annotations

import ast
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from .conftest import PLAIN, noise_left, read_run, reading_of
from .generator.case import AXES
from .generator.chip import OVERSAMPLING, PREROLL_S, TEMPERATURE_NOISE_C, Chip
from .generator.climate import Climate
from .generator.protocol import plans_of
from .generator.session import in_sensor_frame, make


def test_imports_nothing_of_the_tool():
    folder = Path(__file__).parent
    for path in (*(folder / "generator").glob("*.py"), folder / "cases.py", folder / "drawn.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                names = [node.module or ""]
                assert node.level < 2, f"{path.name} imports from outside the generator"
            else:
                continue
            assert not any(name.split(".")[0].startswith("gyrocal") for name in names), path.name


@pytest.mark.parametrize(("protocol", "runs"), [("paper", 6), ("full", 42), ("swing", 18)])
@pytest.mark.parametrize("file_format", ["csv", "parquet"])
def test_session_folder_has_the_documented_format(tmp_path, protocol, runs, file_format):
    case = replace(PLAIN, protocol=protocol, seconds=2.0, file_format=file_format, table_axis="y", table_angle=True)
    truth = make(case, tmp_path)
    session = tomllib.loads((tmp_path / "session.toml").read_text())
    assert session["format"] == "gyrocal-session/1"
    assert session["axis"] == "y"
    assert len(session["run"]) == len(truth.runs) == runs
    assert {path.name for path in tmp_path.iterdir()} == {"session.toml", *(run["file"] for run in session["run"])}
    assert {run["day"] for run in session["run"]} == {1, 2, 3}
    for entry, run in zip(session["run"], truth.runs, strict=True):
        frame = read_run(tmp_path, entry["file"])
        assert frame.columns[:4] == ["t_s", "gx_dps", "gy_dps", "gz_dps"]
        assert np.isfinite(frame.to_numpy()).all()
        t_s = frame["t_s"].to_numpy()
        np.testing.assert_allclose(t_s, run.t_s, atol=1e-6)
        assert np.all(np.diff(t_s) > 0)
        assert np.mean(np.diff(t_s)) == pytest.approx(1 / session["sample_rate_hz"], rel=1e-3)
        side = {"up": 1, "down": -1}[entry["face"]]
        if protocol == "swing":
            assert "table_rate_dps" not in entry
            np.testing.assert_allclose(frame["rate_ref_dps"], run.rate_dps, atol=1e-6)
        else:
            np.testing.assert_allclose(run.rate_dps, side * entry["table_rate_dps"], rtol=1e-12)
    if protocol == "paper":
        faces = [(run["scenario"], run["face"]) for run in session["run"]]
        assert faces == [(f"s{i:03d}", face) for i in range(3) for face in ("up", "down")]
    else:
        assert len({run["scenario"] for run in session["run"]}) == runs


def test_same_seed_same_bytes_and_other_seed_other_noise(tmp_path):
    make(PLAIN, tmp_path / "a")
    make(PLAIN, tmp_path / "b")
    make(replace(PLAIN, seed=12), tmp_path / "c")
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()
        assert path.read_bytes() != (tmp_path / "c" / path.name).read_bytes()


def test_what_the_truth_leaves_is_the_data_sheets_white_noise(tmp_path):
    case = replace(PLAIN, protocol="swing", seconds=20.0, ou_sd_dps=0.003, latitude_deg=40.0)
    truth = make(case, tmp_path)
    noise = noise_left(tmp_path, truth)
    # a second-order Butterworth low-pass passes the noise of 1.1107 times its cut-off
    expected = 3.8e-3 * np.sqrt(1.1107 * 136)
    assert truth.white_sd_dps == pytest.approx(expected, rel=0.03)
    measured = np.sqrt(np.mean(noise**2, axis=(1, 2)))
    np.testing.assert_allclose(measured, np.hypot(truth.white_sd_dps, truth.lsb_dps / np.sqrt(12)), rtol=0.015)
    standard_error = 1 / np.sqrt(noise[0].size)
    for axis in noise:
        assert abs(np.mean(axis)) < 4 * expected * standard_error
        assert abs(np.mean(axis[:, 1:] * axis[:, :-1]) / np.mean(axis**2)) < 0.03
    for i, j in ((0, 1), (1, 2), (0, 2)):
        assert abs(np.corrcoef(noise[i].ravel(), noise[j].ravel())[0, 1]) < 4 * standard_error


def test_low_pass_halves_the_power_at_its_cut_off_and_keeps_a_constant():
    chip = Chip(PLAIN)
    t_s = chip.times(20.0)
    cutoff_hz = 136.0 * chip.odr_hz / 416.0
    passed = chip.low_pass(np.sin(2 * np.pi * cutoff_hz * t_s))[1000:]
    assert np.mean(passed**2) == pytest.approx(0.25, rel=0.01)
    np.testing.assert_allclose(chip.low_pass(np.full(500, 78.0)), 78.0, rtol=1e-9)


def test_polling_takes_the_newest_chip_sample_and_skips_the_rest():
    chip = Chip(PLAIN)
    poll_s = np.arange(2000) / 145.0
    taken = chip.newest(poll_s) / OVERSAMPLING
    age_s = poll_s + PREROLL_S - taken / chip.odr_hz
    assert age_s.min() >= -1e-9
    assert age_s.max() < 1 / chip.odr_hz
    assert set(np.diff(taken)) == {2.0, 3.0}


def test_turn_on_bias_is_one_offset_a_power_cycle(tmp_path):
    truth = make(replace(PLAIN, scenarios=300, seconds=0.1, turn_on_sd_dps=0.02, file_format="parquet"), tmp_path)
    offsets = np.array([run.bias_dps - truth.bias_dps for run in truth.runs])
    np.testing.assert_array_equal(offsets[0::2], offsets[1::2])
    assert np.std(offsets) == pytest.approx(0.02, rel=0.1)
    assert abs(np.mean(offsets)) < 4 * 0.02 / np.sqrt(900)


def test_drift_noise_has_its_spread_and_forgets_exponentially(tmp_path):
    truth = make(replace(PLAIN, scenarios=24, seconds=20.0, ou_sd_dps=0.003, ou_tau_s=1.0), tmp_path)
    drift = np.stack([run.drift_dps for run in truth.runs])
    variance = np.mean(drift**2)
    assert np.sqrt(variance) == pytest.approx(0.003, rel=0.06)
    for lag_s in (0.5, 1.0):
        lag = round(lag_s * 145)
        assert np.mean(drift[..., lag:] * drift[..., :-lag]) / variance == pytest.approx(np.exp(-lag_s), abs=0.06)


def test_drift_noise_goes_on_through_a_power_cycle_and_stays_stationary(tmp_path):
    case = replace(PLAIN, scenarios=400, seconds=0.1, ou_sd_dps=0.003, ou_tau_s=30.0, file_format="parquet")
    truth = make(case, tmp_path)
    ends = np.array([run.drift_dps[:, -1] for run in truth.runs[0::2]])
    starts = np.array([run.drift_dps[:, 0] for run in truth.runs[1::2]])
    assert np.std(ends) == pytest.approx(0.003, rel=0.08)
    assert np.std(starts) == pytest.approx(0.003, rel=0.08)
    # the operator turns the sensor over within 15 to 30 s
    assert np.exp(-30 / 30) - 0.05 < np.mean(ends * starts) / 0.003**2 < np.exp(-15 / 30) + 0.05


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_up_and_down_means_give_the_true_scale_and_bias(tmp_path, seed):
    """The paper's eq. (9)-(10), on data without drift or turn-on bias."""
    truth = make(replace(PLAIN, seed=seed, seconds=20.0, turn_on_sd_dps=0.0, table_axis="y"), tmp_path)
    means = np.array([reading_of(tmp_path, run.file).mean(axis=1) for run in truth.runs])
    up, down = means[0::2].mean(axis=0), means[1::2].mean(axis=0)
    error = 4 * truth.white_sd_dps / np.sqrt(2 * 3 * 20 * 145)
    assert (up[1] - down[1]) / (2 * 78.0) - 1 == pytest.approx(truth.scale[1], abs=error / 78.0)
    np.testing.assert_allclose((up + down) / 2, truth.bias_dps, atol=error)
    assert np.all(np.abs(truth.scale) <= 0.01)


@pytest.mark.parametrize("face", ["up", "down"])
@pytest.mark.parametrize("table_axis", list(AXES))
def test_vectors_fixed_in_the_room_turn_as_the_sensed_rate_says(face, table_axis):
    """da/dt = -omega x a holds in the sensor's frame for gravity and Earth's axis, whichever face is up."""
    rate_dps, t_s = 78.0, np.arange(0, 1, 1e-4)
    vector = in_sensor_frame(table_axis, face, 0.3, 0.9, 25.0 + rate_dps * t_s)
    omega = np.zeros(3)
    omega[AXES.index(table_axis)] = np.radians(rate_dps) * (1 if face == "up" else -1)
    derivative = np.gradient(vector, t_s, axis=1)[:, 1:-1]
    np.testing.assert_allclose(derivative, -np.cross(omega, vector.T).T[:, 1:-1], atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(vector, axis=0), np.hypot(0.3, 0.9), rtol=1e-12)


def test_accelerometer_shows_one_g_towards_the_face(tmp_path):
    truth = make(replace(PLAIN, table_axis="x"), tmp_path)
    for run in truth.runs:
        acceleration = read_run(tmp_path, run.file).select(["ax_g", "ay_g", "az_g"]).to_numpy()
        assert np.mean(np.linalg.norm(acceleration, axis=1)) == pytest.approx(1.0, abs=1e-3)
        assert np.mean(acceleration[:, 0]) == pytest.approx(1.0 if run.face == "up" else -1.0, abs=1e-3)


def test_earth_rate_is_15_degrees_an_hour_at_the_angle_of_the_latitude(tmp_path):
    truth = make(replace(PLAIN, latitude_deg=32.8), tmp_path)
    for run in truth.runs:
        np.testing.assert_allclose(np.linalg.norm(run.earth_dps, axis=0) * 3600, 15.041, rtol=1e-9)
        up = 1.0 if run.face == "up" else -1.0
        np.testing.assert_allclose(run.earth_dps[2] * 3600, up * 15.041 * np.sin(np.radians(32.8)), rtol=1e-9)


@pytest.mark.parametrize("kind", ["room", "chamber"])
def test_temperature_is_smooth_and_its_slope_is_its_derivative(kind):
    case = replace(PLAIN, climate=kind, seconds=30.0)
    plans = plans_of(case)
    climate = Climate(case, plans)
    t_s = np.arange(0, 30, 0.01)
    for plan in plans:
        temp_c, slope = climate(plan, t_s)
        np.testing.assert_allclose(np.gradient(temp_c, t_s)[1:-1], slope[1:-1], atol=1e-5)
        assert np.all(np.abs(temp_c - 25.0) < 12.0)
    # within a power cycle the die goes on from where it was, whatever happens between the runs
    up, down = plans[:2]
    later = np.array([down.start_time_s - up.start_time_s])
    np.testing.assert_allclose(climate(up, later), climate(down, np.array([0.0])), rtol=1e-12)


def test_temperature_column_follows_the_die(tmp_path):
    truth = make(replace(PLAIN, climate="chamber", seconds=20.0), tmp_path)
    for run in truth.runs:
        error = read_run(tmp_path, run.file)["temp_c"].to_numpy() - run.temp_c
        assert np.sqrt(np.mean(error**2)) == pytest.approx(TEMPERATURE_NOISE_C, rel=0.25)
