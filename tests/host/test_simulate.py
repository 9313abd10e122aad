"""The simulator: the pinned campaign errs as the paper's Table 2, noise has the sizes stated, a seed gives one session."""

import json
from pathlib import Path

import numpy as np
import pytest

from gyrocal.session import Session
from gyrocal.simulate import LSB_DPS, WHITE_SD_DPS, ou_noise, paper_windows, simulate


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
