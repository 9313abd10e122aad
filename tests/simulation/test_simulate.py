"""The simulator: the pinned campaign errs as the paper's Table 2, noise has the sizes stated, a seed gives one session."""

import json
from pathlib import Path

import numpy as np
import pytest

from gyrocal.noise.drift import ou_noise
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import LSB_DPS, WHITE_SD_DPS, paper_windows, simulate


def test_the_baseline_errs_as_in_table_2() -> None:
    w = paper_windows(4000, seed=11)
    for seconds, table_mdps in ((2, 55.0), (4, 35.0), (6, 30.0)):
        n = seconds * 145
        up, down = w["up"][:, :n].mean(axis=1), w["down"][:, :n].mean(axis=1)
        scale, bias = (up - down) / 156, (up + down) / 2
        error = np.mean(78 * np.abs(scale - w["scale"]) + np.abs(bias - w["bias_dps"])) / 2
        assert error * 1e3 == pytest.approx(table_mdps, rel=0.3)


def test_the_campaign_is_what_its_fast_windows_are() -> None:
    """Sessions of `table2` and `paper_windows` draw from one distribution: spread of the first 2 s means about the truth."""
    session, truth = simulate(None, "table2", seed=1, scenarios=60, seconds=2.5)
    off = []
    for run, t in zip(session.runs, truth["runs"], strict=True):
        y = run.gyro_dps[:290, 2].mean()
        off.append(y - (1 + t["scale"][2]) * run.rate_dps[0] - t["bias_dps"][2])
    w = paper_windows(3000, seed=2, seconds=2.0)
    fast = w["up"].mean(axis=1) - w["scale"] * 78 - w["bias_dps"]
    assert np.std(off) == pytest.approx(np.std(fast), rel=0.25)


def test_protocols() -> None:
    paper, _ = simulate(None, "paper", seconds=1.0)
    assert [sum(r.day == d for r in paper.runs) for d in (1, 2, 3)] == [26, 14, 56]
    assert {(r.face, r.table_rate_dps) for r in paper.runs} == {("up", 78.0), ("down", 78.0)}
    full, _ = simulate(None, "full", seconds=1.0)
    assert len(full.scenarios) == len(full.runs) == 42
    assert {round(r.table_rate_dps / 10) * 10 for r in full.runs if abs(r.table_rate_dps) < 40} == {0, 30, -30}


def test_a_swinging_table_has_an_encoder() -> None:
    session, _ = simulate(None, "swing", ["lag:tau_s=0.01"], seed=1, scenarios=1, seconds=20.0)
    for run in session.runs:
        rate, angle = run.rate_dps, np.unwrap(np.deg2rad(run.column("table_angle_deg")))
        assert run.table_rate_dps is None
        assert np.abs(rate).max() == pytest.approx(round(np.abs(rate).max(), -1), rel=0.01)
        turned = np.rad2deg(np.gradient(angle, run.t_s)) * run.face_sign
        np.testing.assert_allclose(turned[2:-2], rate[2:-2], atol=0.02 * np.abs(rate).max())
        late = np.interp(run.t_s - 0.01, run.t_s, rate)
        assert np.std(run.gyro_dps[:, 2] - 1.004 * late) < np.std(run.gyro_dps[:, 2] - 1.004 * rate)


def test_the_bench_shows_six_poses_warm_and_cold() -> None:
    session, _ = simulate(None, "bench", seed=1, scenarios=1, seconds=4.0)
    poses = {(run.axis, run.face) for run in session.runs}
    assert len(poses) == 6
    for run in session.runs:
        assert run.acc_g[:, run.axis_index].mean() == pytest.approx(run.face_sign, abs=0.01)
    temp_c = np.concatenate([run.temp_c for run in session.runs])
    assert np.ptp(temp_c) > 25


def test_an_effect_of_the_part_is_on_every_axis_of_the_bench() -> None:
    _, truth = simulate(None, "bench", ["bias_temperature", "table_ripple"], seed=1, scenarios=1, seconds=4.0)
    session, _ = simulate(None, "bench", seed=1, scenarios=1, seconds=4.0)
    for run, planted in zip(session.runs, truth["runs"], strict=True):
        axes = {i: {e["axis"] for e in planted["effects"] if e["id"] == i} for i in ("bias_temperature", "table_ripple")}
        assert axes == {"bias_temperature": {"x", "y", "z"}, "table_ripple": {run.axis}}


@pytest.mark.parametrize("campaign", ["paper", "full"])
def test_temperature_is_not_the_time_since_power_on(campaign: str) -> None:
    """A board that is still warm from the power cycle before, a room that changes: else warm-up and temperature are one."""
    session, _ = simulate(None, campaign, seed=4, scenarios=None if campaign == "full" else 12)
    temp_c = np.array([run.temp_c.mean() for run in session.runs])
    power_on_s = np.array([run.power_on_s for run in session.runs])
    day = np.array([run.day for run in session.runs])
    within = temp_c - np.array([temp_c[day == d].mean() for d in day])
    assert np.std(within) > 0.3
    assert np.corrcoef(temp_c, power_on_s)[0, 1] ** 2 < 0.5
    assert max(np.ptp(run.temp_c) for run in session.runs) > 0.8  # and it moves within a run


def test_what_every_sensor_has_is_set_not_added() -> None:
    """scale, bias, turn_on_bias and colored_noise: the truth says what was asked for, and the readings have it."""
    asked = ["scale:scale=0.01", "bias:bias_dps=0.2", "turn_on_bias:sd_dps=0.5", "colored_noise:sd_dps=0.3,tau_s=1"]
    session, truth = simulate(None, "paper", asked, seed=2, scenarios=20, seconds=8.0)
    assert truth["effects"] == ["bias", "colored_noise", "scale", "turn_on_bias"]
    assert truth["noise"]["ou_sd_dps"] == 0.3
    assert {tuple(run["scale"]) for run in truth["runs"]} == {(0.01, 0.01, 0.01)}
    offsets = np.array([run["bias_dps"] for run in truth["runs"]])[::2]
    assert np.std(offsets) == pytest.approx(0.5, rel=0.25)
    assert np.mean(offsets) == pytest.approx(0.2, abs=0.25)
    drift = np.concatenate(
        [r.gyro_dps[:, 2] - 1.01 * r.rate_dps - t["bias_dps"][2] for r, t in zip(session.runs, truth["runs"], strict=True)]
    )
    lag = 145  # one time constant
    assert np.cov(drift[:-lag], drift[lag:])[0, 1] == pytest.approx(0.09 * np.exp(-1), rel=0.4)


def test_noise_and_counts() -> None:
    session, _ = simulate(None, "paper", seed=3, scenarios=1)
    y = session.runs[0].gyro_dps
    assert np.std(np.diff(y[:, 0])) / np.sqrt(2) == pytest.approx(np.hypot(WHITE_SD_DPS, LSB_DPS / np.sqrt(12)), rel=0.02)
    assert np.abs(y / LSB_DPS - np.rint(y / LSB_DPS)).max() < 1e-3
    drift = ou_noise(200_000, 0.1, 0.002, 30.0, 1, np.random.default_rng(0))[:, 0]
    assert np.std(drift) == pytest.approx(0.002, rel=0.1)
    assert np.corrcoef(drift[:-300], drift[300:])[0, 1] == pytest.approx(np.exp(-1), abs=0.05)


def test_the_same_seed_gives_the_same_files(tmp_path: Path) -> None:
    for name in ("a", "b"):
        simulate(tmp_path / name, "paper", ["table_ripple"], 7, scenarios=1, seconds=3.0)
    files = sorted(p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*") if p.is_file())
    for file in files:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
    truths = [json.loads((tmp_path / f"{n}.truth.json").read_text()) for n in ("a", "b")]
    assert truths[0] == truths[1]
    assert Session.open(tmp_path / "a").runs[0].face == "up"


def test_every_planted_phase_is_in_the_truth() -> None:
    _, truth = simulate(None, "paper", ["table_ripple:amplitude_1=0.002"], scenarios=2, seconds=2.0)
    phases = [run["effects"][0]["phase_1_deg"] for run in truth["runs"]]
    assert len(set(phases)) == 4  # of its own in each run
    assert all(run["effects"][0]["amplitude_1"] == 0.002 for run in truth["runs"])
