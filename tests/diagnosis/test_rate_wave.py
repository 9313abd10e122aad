"""A wave over the rate's value is unknown, against the rate; what depends on the rate in a known way keeps its name."""

from collections.abc import Callable

import numpy as np
import pytest

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.recording.session import Session
from known import ON_Z
from make_runs import Array, make_run, make_session

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("tests_alone")]
RATE_HZ, SECONDS, HIGHEST_DPS = 50.0, 40.0, 150.0
T_S = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ


def by_hand(rng: np.random.Generator) -> Array:
    """Turns to and fro of different lengths and speeds, with a rest after each."""
    rate, at_s, sign = np.zeros(T_S.size), 1.0, 1.0
    while at_s < SECONDS - 4:
        length_s = rng.uniform(1.5, 3.5)
        part = np.clip((T_S - at_s) / length_s, 0.0, 1.0)
        rate += sign * HIGHEST_DPS * rng.uniform(0.2, 1.0) * np.sin(np.pi * part) ** 2
        at_s, sign = at_s + length_s + rng.uniform(0.3, 1.0), -sign
    return rate


def staircase(rng: np.random.Generator) -> Array:
    """Nine levels up and down, which differ by nearly the period of the wave, with ramps between them."""
    up = np.linspace(0.0, HIGHEST_DPS, 5)
    levels = np.concatenate([up, up[-2::-1], -up[1:], -up[-2::-1]])
    at = np.linspace(0.0, levels.size, T_S.size, endpoint=False)
    step, part = at.astype(int), np.clip((at % 1 - 0.7) / 0.3, 0.0, 1.0)
    return levels[step] + (levels[np.minimum(step + 1, levels.size - 1)] - levels[step]) * part


def session(motion: Callable[[np.random.Generator], Array], error_dps: Callable[[Array], Array], seed: int) -> Session:
    rng = np.random.default_rng(seed)
    made = []
    for i in range(6):
        rate = motion(rng)
        gyro = rng.normal(0, 0.05, (T_S.size, 3))
        gyro[:, 2] += 1.004 * rate + 0.3 + error_dps(rate)
        made.append(make_run(T_S, gyro, scenario=f"s{i}", day=1 + i % 3, rate_ref_dps=rate))
    return make_session(*made)


def seven_rates(rng: np.random.Generator) -> Array:
    """Seven levels that the table holds to a thousandth, with nothing measured between them."""
    level = rng.choice([-150.0, -78.0, -30.0, 0.0, 30.0, 78.0, 150.0], 12)
    return np.repeat(level, -(-T_S.size // 12))[: T_S.size] * (1 + 1e-3 * rng.standard_normal())


@pytest.mark.wide
def test_no_wave_is_told_between_rates_that_nobody_measured() -> None:
    """A cubic at seven rates was also told as a wave over the rate with a period of 46.7 deg/s."""
    found = diagnose(session(seven_rates, lambda rate: 3e-8 * rate**3, seed=5), ON_Z)
    assert found.comparison.where
    assert not any("wave over the rate" in finding.note for finding in found.comparison.where)
    assert found.best is not None
    assert "scale_nonlinearity" in (found.best.effect.id, *found.best.group)


@pytest.mark.wide
@pytest.mark.parametrize(("motion", "period_dps"), [(by_hand, 28.0), (staircase, 44.0)])
def test_a_wave_over_the_rate_is_unknown(motion: Callable[[np.random.Generator], Array], period_dps: float) -> None:
    """It was named an asymmetry of the scale, or a tone that the steps of a staircase resemble."""
    wave = session(motion, lambda rate: 0.06 * np.sin(2 * np.pi * rate / period_dps + 2.5), seed=3)
    found = diagnose(wave, ON_Z)
    assert (found.verdict, found.unknown is not None and found.unknown["against"]) == ("unknown", "rate")
    assert found.unknown is not None
    assert float(found.unknown["shape"].split("period of ")[1].split()[0]) == pytest.approx(period_dps, rel=0.05)
    said_dps = float(found.unknown["shape"].split("rms ")[1].split()[0]) / 1000
    drawn = np.concatenate([0.06 * np.sin(2 * np.pi * r.rate_dps / period_dps + 2.5) for r in wave.runs])
    known = np.column_stack([np.ones(drawn.size), np.concatenate([r.rate_dps for r in wave.runs])])
    drawn -= known @ np.linalg.lstsq(known, drawn, rcond=None)[0]
    assert said_dps == pytest.approx(float(np.std(drawn)), rel=0.2)


@pytest.mark.wide
@pytest.mark.parametrize(
    ("effect_id", "error_dps"),
    [
        pytest.param("scale_asymmetry", lambda rate: 5e-4 * np.abs(rate), marks=pytest.mark.wide),
        ("scale_nonlinearity", lambda rate: 5e-8 * rate**3),
        ("dead_band", lambda rate: np.where(np.abs(rate) < 1.0, -rate, 0.0)),
    ],
)
def test_what_depends_on_the_rate_in_a_known_way_keeps_its_name(effect_id: str, error_dps: Callable[[Array], Array]) -> None:
    found = diagnose(session(by_hand, error_dps, seed=4), ON_Z)
    assert found.best is not None
    assert found.verdict in ("add", "ambiguous")
    assert effect_id in (found.best.effect.id, *found.best.group)


def repeated(rng: np.random.Generator) -> Array:
    """Steps of the rate that begin at any time, each of them through the same few rates."""
    levels = np.tile([0.0, 150.0, 0.0, -150.0], 20)
    held = np.repeat(levels, rng.integers(15, 60, levels.size))[: T_S.size]
    return np.convolve(held, np.ones(13) / 13, "same")


@pytest.mark.parametrize("seed", [2, 3, pytest.param(4, marks=pytest.mark.wide)])
def test_rounding_of_the_reference_is_no_wave_over_the_rate(seed: int) -> None:
    """A motion that is repeated meets the same rounding at each of its rates, and that does not average out."""
    clean, step_dps = session(repeated, lambda rate: 0 * rate, seed), 0.25
    runs = []
    for run in clean.runs:
        rounded = step_dps * np.rint(run.rate_dps / step_dps)
        runs.append(make_run(T_S, run.gyro_dps, scenario=run.scenario, day=run.day, rate_ref_dps=rounded))
    found = diagnose(make_session(*runs), ON_Z)
    assert not [finding for finding in found.comparison.where if finding.against == "rate"]
