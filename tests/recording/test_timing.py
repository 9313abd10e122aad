"""The true rate between its samples: late, filtered, by another clock; and a noisy reference smoothed."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import make_smoothing_spline

from gyrocal.recording.timing import Motion, Timing, between, noise_sd, smooth, smoothing_spline
from make_runs import make_run

RNG = np.random.default_rng(4)
T_S = np.sort(np.arange(3000) / 100 + RNG.uniform(0, 0.004, 3000))


def swing_dps(t_s: np.ndarray) -> np.ndarray:
    return 60 * np.sin(2 * np.pi * 0.4 * t_s) + 25 * np.sin(2 * np.pi * 1.1 * t_s + 1)


MOTION = Motion(T_S, swing_dps(T_S))
TIMINGS = [Timing(delay_s=0.137), Timing(delay_s=-0.02), Timing(clock=0.02), Timing(delay_s=0.05, clock=-0.01)]


@pytest.mark.parametrize("timing", TIMINGS)
def test_a_late_reading_and_a_wrong_clock_show_the_rate_of_another_moment(timing: Timing) -> None:
    want = swing_dps(T_S[0] + (1 + timing.clock) * (T_S - T_S[0]) - timing.delay_s)
    reached = MOTION.reached(T_S, timing)
    assert reached.mean() > 0.97
    assert np.max(np.abs(MOTION.rate_dps(T_S, timing) - want)[reached]) < 1e-3


@pytest.mark.parametrize("tau_s", [0.002, 0.05, 0.3])
def test_a_filter_follows_its_differential_equation(tau_s: float) -> None:
    def pull(t: float, x: np.ndarray) -> np.ndarray:
        return (swing_dps(np.array([t])) - x) / tau_s

    reached = MOTION.reached(T_S, Timing(filter_s=tau_s))
    solved = solve_ivp(pull, (T_S[0] - 20 * tau_s, T_S[-1]), [0.0], t_eval=T_S[reached], method="LSODA", rtol=1e-9, atol=1e-9)
    assert reached.mean() > 0.85
    assert np.max(np.abs(MOTION.rate_dps(T_S, Timing(filter_s=tau_s))[reached] - solved.y[0])) < 5e-3


@pytest.mark.parametrize("timing", [*TIMINGS, Timing(filter_s=0.05, clock=0.01), Timing(filter_s=0.3)])
def test_derivatives_by_each_parameter(timing: Timing) -> None:
    """Against differences over a thousandth of the parameter's scale, where all three moments are recorded."""
    for name, derivative, step in (
        ("delay_s", MOTION.by_delay, 1e-5), ("clock", MOTION.by_clock, 1e-6), ("filter_s", MOTION.by_filter, 1e-5),
    ):  # fmt: skip
        value = getattr(timing, name)
        if name == "filter_s" and value == 0:
            continue
        low, high = (Timing(**{**vars(timing), name: value + sign * step}) for sign in (-1, 1))
        reached = MOTION.reached(T_S, low) & MOTION.reached(T_S, high)
        want = (MOTION.rate_dps(T_S, high) - MOTION.rate_dps(T_S, low))[reached] / (2 * step)
        got = derivative(T_S, timing)[reached]
        np.testing.assert_allclose(got, want, atol=2e-3 * np.max(np.abs(want)))


def test_moments_without_a_reference_are_not_reached() -> None:
    """Before the first sample, after the last, and in a gap of the reference."""
    t_s = np.arange(1000) / 100
    holed = np.where((t_s > 5) & (t_s < 5.5), np.nan, swing_dps(t_s))
    run = make_run(t_s, rate_ref_dps=holed)
    assert run.reached.all()
    late = run.timed(Timing(delay_s=0.2))
    np.testing.assert_array_equal(late.reached[:18], False)
    gap = ~late.reached[100:]
    assert gap.sum() == pytest.approx(48, abs=2)
    np.testing.assert_allclose(t_s[100:][gap].mean(), 5.45, atol=0.01)
    assert not run.timed(Timing(clock=0.02)).reached[-15:].any()


def test_a_run_of_constant_rate_has_no_timing() -> None:
    run = make_run(np.arange(100) / 100)
    assert run.timed(Timing(delay_s=0.1)) is run


def test_the_smoothing_spline_is_scipy_s() -> None:
    noisy = swing_dps(T_S) + RNG.normal(0, 1, T_S.size)
    np.testing.assert_allclose(smoothing_spline(T_S, noisy, 1e-5), make_smoothing_spline(T_S, noisy, lam=1e-5)(T_S), atol=1e-8)


@pytest.mark.parametrize("sd", [0.02, 0.2, 2.0])
def test_a_noisy_reference_is_smoothed_and_its_noise_known(sd: float) -> None:
    noisy = swing_dps(T_S) + RNG.normal(0, sd, T_S.size)
    assert noise_sd(T_S, noisy) == pytest.approx(sd, rel=0.05)
    assert np.std(smooth(T_S, noisy) - swing_dps(T_S)) < 0.55 * sd


def test_smoothing_takes_next_to_nothing_from_the_motion() -> None:
    """A part of the motion that stays at its own time while a clock runs off would be taken for an error of that clock."""
    t_s = np.arange(0.0, 300.0, 0.05)
    motion_dps = 80 * np.sin(2 * np.pi * 0.35 * t_s)
    noise_dps = np.random.default_rng(4).normal(0, 0.2, t_s.size)
    left_dps = (smooth(t_s, motion_dps + noise_dps) + smooth(t_s, motion_dps - noise_dps)) / 2
    assert float(left_dps @ motion_dps) / float(motion_dps @ motion_dps) == pytest.approx(1, abs=1e-6)


def test_a_clean_reference_is_left_as_it_is() -> None:
    rounded = np.round(swing_dps(T_S), 6)
    assert smooth(T_S, rounded) is rounded


def test_a_slower_reference_keeps_its_amplitude_between_its_samples() -> None:
    """Lines between samples of 20 Hz take 0.8 % of a motion of 1 Hz, twice the scale error of a good sensor."""
    t_s, slow_s = np.arange(2000) / 100, np.arange(400) / 20 + 0.003

    def rate_dps(at_s: np.ndarray) -> np.ndarray:
        return 60 * np.sin(2 * np.pi * at_s)

    at = between(slow_s, rate_dps(slow_s), t_s, 0.2)
    inside = np.isfinite(at)
    assert inside[1:-5].all()
    assert not inside[0]
    np.testing.assert_allclose(at[20:-20], rate_dps(t_s)[20:-20], atol=60 * 5e-5)
    sparse = np.where(np.arange(t_s.size) % 5 == 0, rate_dps(t_s), np.nan)
    sparse[1000:1500] = np.nan
    run = make_run(t_s, rate_ref_dps=sparse)
    np.testing.assert_allclose(run.rate_dps[20:980], rate_dps(t_s)[20:980], atol=60 * 5e-5)
    assert np.abs(np.diff(run.rate_dps[996:1500], 2)).max() < 1e-9, "a line across the gap"


def test_a_gap_of_a_slower_reference_stays_empty() -> None:
    known_s = np.concatenate([np.arange(20) / 20, 3 + np.arange(20) / 20])
    at = between(known_s, np.sin(known_s), np.array([0.5, 0.94, 0.96, 2.0, 2.99, 3.01]), 0.15)
    assert np.isfinite(at).tolist() == [True, True, False, False, False, True]
