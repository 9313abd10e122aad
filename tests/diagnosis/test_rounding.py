"""Readings that are coarser than their noise: rounding is no misfit, and an effect larger than it is still found."""

from dataclasses import replace

import numpy as np
import pytest

from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.diagnosis.residual.rounding import amplitudes_dps
from gyrocal.recording.session import Session
from known import ON_Z
from make_runs import make_run, make_session

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("tests_alone")]
COUNT_DPS, SD_DPS = 0.1, 0.029


def staircase(k: float = 0.0, sd_dps: float = SD_DPS, apart_dps: float | None = None, seed: int = 7) -> Session:
    """Two runs on a table that goes to twelve rates, 8 s each, at 100 deg/s^2; ``k`` is a scale asymmetry.

    The offsets of their power cycles are drawn, or differ by ``apart_dps``.
    """
    rng = np.random.default_rng(seed)
    levels = np.array([0, 50, 100, 200, 100, 50, 0, -50, -100, -200, -100, -50, 0])
    start_s = 8.0 * np.arange(12)
    times_s = np.sort(np.concatenate([start_s, start_s + np.abs(np.diff(levels)) / 100]))
    rate_dps = np.interp(np.arange(9600) / 100, times_s, np.repeat(levels, 2)[1:-1])
    runs = []
    for i in range(2):
        offset_dps = rng.normal(0, 0.01, 3) if apart_dps is None else i * apart_dps
        gyro = rng.normal(offset_dps, sd_dps, (rate_dps.size, 3))
        gyro[:, 2] += 0.98457 * rate_dps + k * np.abs(rate_dps) - 3.7637
        runs.append(make_run(
            np.arange(rate_dps.size) / 100, np.round(gyro / COUNT_DPS) * COUNT_DPS, scenario=f"s{i}", lsb_dps=COUNT_DPS,
            rate_ref_dps=rate_dps,
        ))  # fmt: skip
    return make_session(*runs, lsb_dps=COUNT_DPS)


def test_rounding_is_no_misfit() -> None:
    assert compare(staircase()).verdict == "adequate"


@pytest.mark.wide
@pytest.mark.parametrize(
    ("apart_dps", "seed"), [(0.012, 20), *(pytest.param(*of, marks=pytest.mark.wide) for of in ((0.02, 21), (0.03, 22)))]
)
def test_the_level_of_each_power_cycle_is_rounded(apart_dps: float, seed: int) -> None:
    """Offsets of a tenth of a count move the rounding error by a tenth of its period."""
    assert compare(staircase(sd_dps=0.024, apart_dps=apart_dps, seed=seed), ON_Z).verdict == "adequate"


@pytest.mark.wide
def test_a_harmonic_that_cannot_be_seen_does_not_bring_rounding_back() -> None:
    """The second harmonic, of 0.1 mdps, had an error of 1.1 mdps, and the first one, of 7 mdps, was reported."""
    assert compare(staircase(apart_dps=0.0, seed=2), ON_Z).verdict == "adequate"


@pytest.mark.wide
def test_a_larger_effect_is_found_beside_rounding() -> None:
    found = compare(staircase(k=0.001))
    assert found.verdict == "misfit"
    assert {f.axis for f in found.where} == {"z"}


@pytest.mark.wide
def test_a_grid_that_is_coarser_than_the_stated_count_makes_no_jumps() -> None:
    """A steady rate's error of rounding changes with each step of the table."""
    made = staircase(sd_dps=0.017)
    stated = made.with_runs(replace(run, lsb_dps=COUNT_DPS / 4) for run in made.runs)
    found = diagnose(replace(stated, lsb_dps=COUNT_DPS / 4), ON_Z)
    assert {c.effect.id for c in found.candidates if c.named} <= {"quantization"}


def power_cycles(sd_counts: float, seed: int, wave: float = 0.0) -> Session:
    """Fourteen power cycles at seven rates with a slow drift of a tenth of a count; ``wave``: ripple of the table."""
    rng, t_s = np.random.default_rng(seed), np.arange(1500) / 50
    runs = []
    for i, rate_dps in enumerate((0, 30, -30, 78, -78, 150, -150) * 2):
        offset_dps = rng.normal(0, 0.06, 3)
        drift_dps = np.cumsum(rng.normal(0, 0.1 * COUNT_DPS / np.sqrt(1500), (1500, 3)), axis=0)
        gyro = offset_dps + drift_dps + rng.normal(0, sd_counts * COUNT_DPS, (1500, 3))
        gyro[:, 2] += 0.99 * rate_dps * (1 + wave * np.sin(np.deg2rad(rate_dps * t_s)))
        runs.append(make_run(
            t_s, np.round(gyro / COUNT_DPS) * COUNT_DPS, scenario=f"s{i}", table_rate_dps=float(rate_dps), lsb_dps=COUNT_DPS,
            day=1 + i % 3,
        ))  # fmt: skip
    return make_session(*runs, lsb_dps=COUNT_DPS)


@pytest.mark.wide
@pytest.mark.parametrize("sd_counts", [0.1, *(pytest.param(of, marks=pytest.mark.wide) for of in (0.2, 0.3))])
def test_readings_that_stand_at_one_count_are_no_quieter_noise(sd_counts: float) -> None:
    found = compare(power_cycles(sd_counts, 0), ON_Z)
    assert found.verdict == "adequate", found.where


@pytest.mark.wide
def test_a_ripple_is_found_in_readings_that_stand_at_one_count() -> None:
    found = compare(power_cycles(0.2, 0, wave=0.002))
    assert found.verdict == "misfit"
    assert {f.axis for f in found.where} == {"z"}


def test_amplitudes_are_those_of_rounded_normal_noise() -> None:
    at = np.linspace(0, 1, 100, endpoint=False) * COUNT_DPS
    noise = np.random.default_rng(1).normal(0, SD_DPS, (100_000, 1))
    readings = np.round((at + noise) / COUNT_DPS) * COUNT_DPS
    error_dps = readings.mean(axis=0) - at
    (first, *_) = amplitudes_dps(COUNT_DPS, float(np.mean(np.var(readings, axis=0))))
    assert first == pytest.approx(2 * np.mean(-error_dps * np.sin(2 * np.pi * at / COUNT_DPS)), rel=0.2)
    assert amplitudes_dps(COUNT_DPS, 0.06**2 + COUNT_DPS**2 / 12).size == 0
