"""The error of a dead band's width holds with an encoder's noise and where smoothing rounds the corners of a motion."""

import numpy as np
import pytest
from scipy.signal import lfilter

from encoders import session_of_moves
from gyrocal.effects.base import Objection, effect
from gyrocal.effects.dead_band import outliers_of
from gyrocal.effects.quantities import rate_about
from gyrocal.recording.session import Run
from make_runs import make_run

WIDTH_DPS = 1.0


def staircase(k: int, noise_dps: float, levels: tuple[float, ...]) -> Run:
    """Ramps between levels in an order of its own; true rates below the width read zero."""
    rng = np.random.default_rng(k)
    order = rng.permutation(np.array(levels))
    corners = np.arange(order.size)[:, None] * 500 + np.array([0, 400])
    rate = np.interp(np.arange(500 * order.size), corners.ravel(), order.repeat(2))
    read = 1.01 * np.where(np.abs(rate) < WIDTH_DPS, 0.0, rate) + 0.7
    gyro = rng.normal(0, 0.05, (rate.size, 3)) + np.outer(read, [0, 0, 1])
    return make_run(np.arange(rate.size) / 100.0, gyro, rate_ref_dps=rate + rng.normal(0, noise_dps, rate.size))


def likeliest_dps(runs: list[Run]) -> float:
    """The width that sorts most of the readings rightly, as a fit does."""
    w = np.concatenate([np.abs(rate_about(r, 2)) for r in runs])
    y = np.concatenate([np.abs(r.gyro_dps[:, 2] - 0.7) for r in runs])
    widths = np.linspace(0.8, 1.2, 801)
    squares = [float(np.sum((y - 1.01 * np.where(w < width, 0.0, w)) ** 2)) for width in widths]
    return float(widths[int(np.argmin(squares))])


def error_dps(runs: list[Run], width_dps: float) -> float:
    return effect("dead_band").refinement("width_dps", {"width_dps": width_dps, "depth": 1.0}, runs, 2).resolution


@pytest.mark.parametrize("levels", [(-4, -2, -0.7, -0.4, 0, 0.4, 0.7, 2, 4), (-20, -5, -1, 0, 1, 5, 20)])
@pytest.mark.parametrize("noise_dps", [0.003, 0.01, 0.05])
def test_the_width_s_error_holds(noise_dps: float, levels: tuple[float, ...]) -> None:
    off = []
    for seed in range(5):
        runs = [staircase(10 * seed + k, noise_dps, levels) for k in range(4)]
        width = likeliest_dps(runs)
        off.append((width - WIDTH_DPS) / error_dps(runs, width))
    assert np.max(np.abs(off)) < 3.0


def test_the_width_s_error_is_small_where_the_rate_is_known() -> None:
    runs = [staircase(k, 1e-6, (-4, -2, -0.7, -0.4, 0, 0.4, 0.7, 2, 4)) for k in range(4)]
    assert error_dps(runs, likeliest_dps(runs)) < 0.03


def test_a_band_that_ends_below_rates_that_are_lost_too_has_no_edge() -> None:
    """Beside a coarse encoder a band of 1.2 +- 18.8 dps was named."""
    runs = [staircase(k, 1e-6, (-4, -2, -0.7, -0.4, 0, 0.4, 0.7, 2, 4)) for k in range(4)]

    def contradicted(width_dps: float) -> bool:
        values = {"width_dps": width_dps, "depth": 0.9}
        return Objection.CONTRADICTED in effect("dead_band").objections(values, runs, 2, ())

    assert contradicted(0.2)
    assert not contradicted(WIDTH_DPS)


def test_samples_that_no_reference_reaches_say_nothing_of_the_width() -> None:
    """By its own clock a reference ends before the readings: a width of 0.34 had an error of 16.5 deg/s."""
    run = staircase(0, 1e-6, (-4, -2, -0.7, -0.4, 0, 0.4, 0.7, 2, 4))
    gyro, angle_deg = run.gyro_dps.copy(), np.cumsum(run.rate_dps) / run.sample_rate_hz
    end = int(np.flatnonzero(np.abs(run.rate_dps) > 3.0)[-1])
    angle_deg[end - 100 :], gyro[end - 100 :, 2] = np.nan, 0.7
    cut = make_run(run.t_s, gyro, table_rate_dps=None, ref_angle_deg=angle_deg)
    assert np.abs(rate_about(cut, 2)[-1]) > 3.0
    assert error_dps([cut], WIDTH_DPS) < 0.3


@pytest.mark.parametrize("seed", range(4))
def test_the_round_corners_of_a_coarse_angle_are_no_dead_band(seed: int) -> None:
    runs = list(session_of_moves(seed, 0.05, 0.1).runs)
    assert effect("dead_band").tried_on(runs, 2, 1e-4) is None


@pytest.mark.parametrize("seed", range(4))
def test_a_reference_that_wanders_at_rest_is_no_dead_band(seed: int) -> None:
    """What the reference alone does is in no reading, as in a dead band, but it is lost at every rate and has no edge."""
    rng, runs = np.random.default_rng(seed), []
    for _ in range(4):
        true = np.interp(np.arange(6000), [0, 2000, 2100, 3900, 4000, 5999], [0.0, 0.0, 78.0, 78.0, 0.0, 0.0])
        wander = lfilter([0.03 * np.sqrt(1 - 0.98**2)], [1, -0.98], rng.normal(size=6000))
        gyro = rng.normal(0, 0.05, (6000, 3)) + np.outer(1.01 * true + 0.7, [0, 0, 1])
        runs.append(make_run(np.arange(6000) / 100.0, gyro, rate_ref_dps=true + wander))
    assert effect("dead_band").tried_on(runs, 2, 0.01) is None


@pytest.mark.parametrize("levels", [(-4, -2, -0.7, -0.4, 0, 0.4, 0.7, 2, 4), (-20, -5, -1, 0, 1, 5, 20)])
def test_a_band_shows_by_its_edge(levels: tuple[float, ...]) -> None:
    assert effect("dead_band").tried_on([staircase(k, 0.003, levels) for k in range(4)], 2, 0.01) == "samples"


def at_steps(lost_below_dps: float, levels: tuple[float, ...], seed: int = 1) -> list[Run]:
    """A table whose angle is measured goes to each level in a second, stays for eight, and goes back to rest."""
    rng, runs = np.random.default_rng(seed), []
    true = np.concatenate([np.interp(np.arange(800), [0, 50, 450, 500], [0.0, level, level, 0.0]) for level in levels])
    for _ in range(3):
        read = 1.002 * np.where(np.abs(true) < lost_below_dps, 0.0, true) + 0.4
        gyro = rng.normal(0, 0.02, (true.size, 3)) + np.outer(read, [0, 0, 1])
        angle_deg = np.cumsum(true) / 50 + rng.uniform(0, 360)
        runs.append(make_run(np.arange(true.size) / 50, gyro, ref_angle_deg=np.round(angle_deg / 0.002) * 0.002))
    return runs


def tried(runs: list[Run]) -> bool:
    return effect("dead_band").tried_on(runs, 2, 1.0) is not None


@pytest.mark.parametrize("seed", range(3))
def test_where_a_measured_angle_is_round_no_rate_is_lost(seed: int) -> None:
    """At the corners, the slope of the curve through the angle is a small rate that the table never had."""
    assert not tried(at_steps(0.0, (150, -150, 60, -60), seed))


def test_a_band_that_the_table_stays_in_shows_in_a_measured_angle() -> None:
    assert tried(at_steps(1.0, (150, 0.5, -0.7, -150, 0.6)))


def test_what_stands_out_of_the_reference_is_no_reading() -> None:
    """An encoder that counts seldom gives a rate in pulses; the same pulses in the readings are outliers."""
    rng = np.random.default_rng(2)
    pulses = 0.4 * (rng.random(4000) < 0.02)
    noise = rng.normal(0, 0.02, (4000, 3))
    for own in (False, True):
        gyro = noise + np.outer(0.3 + own * pulses, [0, 0, 1])
        run = make_run(np.arange(4000) / 100, gyro, rate_ref_dps=0.3 + (not own) * pulses)
        rows, apart_dps = outliers_of(run, 2, gyro[:, 2] - run.column("rate_ref_dps"))
        assert rows.size == own * np.count_nonzero(pulses)
        assert apart_dps == pytest.approx(0.4, abs=0.1)
