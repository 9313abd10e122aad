"""Readings that a logger stores more often than the sensor takes them are told; equal readings by chance are not."""

import re
from pathlib import Path

import numpy as np
import pytest

from gyrocal.recording.hung import read_too_fast, repeated
from gyrocal.recording.import_options import Options
from gyrocal.recording.importer import read_recording
from make_runs import make_run

COUNT_DPS = 0.07


def at_rest(hold: float, noise_counts: float, axes: int = 3) -> np.ndarray:
    """4000 samples of three axes of which each reading is stored ``hold`` times, deg/s [4000, 3]."""
    rng = np.random.default_rng(4)
    counts = np.rint(rng.normal(0.3, noise_counts, (4000, 3)))
    counts[:, axes:] = 0
    return np.asarray(COUNT_DPS * counts[(np.arange(4000) / hold).astype(int)])


@pytest.mark.parametrize("axes", [1, 3])
@pytest.mark.parametrize("noise_counts", [5.0, 50.0])
@pytest.mark.parametrize("hold", [1.2, 2.0, 3.0, 10.0])
def test_the_sensor_s_own_rate_is_told(hold: float, noise_counts: float, axes: int) -> None:
    readings = at_rest(hold, noise_counts, axes)
    told = read_too_fast(make_run(np.arange(4000) / 200.0, readings, table_rate_dps=0.0, rate_hz=200.0))
    assert told is not None
    assert told.code == "sample_rate"
    assert not told.blocking
    named = re.search(r"takes about (\S+) readings", told.text)
    assert named is not None
    assert float(named[1]) == pytest.approx(200.0 / hold, rel=0.06)


@pytest.mark.parametrize("noise_counts", [0.2, 0.6, 5.0])
def test_equal_readings_by_chance_are_not_told(noise_counts: float) -> None:
    assert read_too_fast(make_run(np.arange(4000) / 200.0, at_rest(1.0, noise_counts), table_rate_dps=0.0)) is None


def test_slow_motion_in_coarse_counts_is_not_told() -> None:
    """A part that stands and turns in turns, with counts that hide its noise, repeats most of its readings by itself."""
    t_s = np.arange(4000) / 200.0
    rate_dps = 2.0 * np.maximum(0.0, np.sin(2 * np.pi * t_s / 7.0))[:, None] * [1.0, 0.3, -0.8]
    noise_dps = np.random.default_rng(2).normal(0.0, 0.1 * COUNT_DPS, (4000, 3))
    readings = COUNT_DPS * np.rint((rate_dps + noise_dps) / COUNT_DPS)
    assert read_too_fast(make_run(t_s, readings, table_rate_dps=0.0)) is None


def test_neither_is_a_part_that_hung_nor_one_without_noise() -> None:
    hung = at_rest(1.0, 5.0)
    hung[1000:2000] = hung[1000]
    assert read_too_fast(make_run(np.arange(4000) / 200.0, hung, table_rate_dps=0.0)) is None
    assert read_too_fast(make_run(np.arange(4000) / 200.0, np.zeros((4000, 3)), table_rate_dps=0.0)) is None


def test_import_tells_it(tmp_path: Path) -> None:
    rows = np.column_stack([np.arange(4000) / 200.0, at_rest(2.0, 5.0)])
    np.savetxt(tmp_path / "log.csv", rows, fmt="%.6f", delimiter=",", header="t,gx_dps,gy_dps,gz_dps", comments="")
    found = read_recording(tmp_path / "log.csv", Options(defaults={"table_rate_dps": 0.0, "face": "up"}))
    assert [(w.code, w.file) for w in found.warnings] == [("sample_rate", found.session.runs[0].file)]


def test_a_coarse_sensor_that_hung_is_left_out_too() -> None:
    """Coarse readings often repeat by themselves, in short stretches: those of a hundred samples were kept."""
    t_s = np.arange(4000) / 100.0
    readings = at_rest(1.0, 1.0)
    for first in (700, 1000, 3000, 3700):
        readings[first : first + 100] = readings[first]
    assert np.mean(np.all(np.diff(readings[1200:2900], axis=0) == 0, axis=1)) > 0.015
    hung = repeated(t_s, list(readings.T))
    assert np.flatnonzero(np.diff(hung.astype(int)) == 1).tolist() == [700, 1000, 3000, 3700]
    assert hung.sum() >= 4 * 99
    still = COUNT_DPS * np.rint(np.random.default_rng(6).normal(0.0, 0.12, (4000, 3)))
    assert not repeated(t_s, list(still.T)).any()
