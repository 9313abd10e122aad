"""Each effect against its physics: closed forms, symmetries, limits, units."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from gyrocal.effects.base import Effect, effect, effects, table_angle_rad
from gyrocal.effects.bias_jumps import jumps
from gyrocal.effects.earth_rate import in_known_rate, known_dps
from gyrocal.effects.quantities import temperature_slope_c_s
from gyrocal.recording.session import Run
from gyrocal.recording.timing import Timing

from .checks import check_degree, check_law
from .conftest import Array, MakeRun

W = 90.0
"""Amplitude of the swing of rich_run."""


@pytest.mark.parametrize("kind", [k for k in effects().values() if k.law and k.law.reads], ids=lambda k: k.id)
def test_term_is_what_the_law_says(kind: Effect, rich_run: Run) -> None:
    check_law(kind, rich_run)


@pytest.mark.parametrize("kind", [k for k in effects().values() if k.law], ids=lambda k: k.id)
def test_parity_and_degree_in_the_rate(kind: Effect, make_run: MakeRun) -> None:
    check_degree(kind, make_run)


def test_law_of_a_column_s_slope(rich_run: Run) -> None:
    """The slope is of the smoothed column: over 10 s of a period of 120 s."""
    t_s = rich_run.t_s
    want = 0.4 * 15 * 2 * np.pi / 120 * np.cos(2 * np.pi * t_s / 120)
    got = effect("thermal_lag").term(rich_run, 2, {"k_dps_s_per_c": 0.4})
    assert np.max(np.abs(got - want)) <= 0.05 * np.max(np.abs(want))


@pytest.mark.parametrize(("effect_id", "values", "moment"), [
    ("lag", {"tau_s": 0.004}, lambda t: t - 0.004),
    ("lag", {"tau_s": 0.3}, lambda t: t - 0.3),
    ("clock_error", {"e": 0.001}, lambda t: 1.001 * t),
    ("clock_error", {"e": -0.02}, lambda t: 0.98 * t),
])  # fmt: skip
def test_effects_of_time_show_the_rate_of_another_moment(
    effect_id: str, values: dict[str, float], moment: Callable[[Array], Array], rich_run: Run
) -> None:
    """At any size, wherever that moment was recorded."""
    t_s = rich_run.t_s

    def swing(t: Array) -> Array:
        return W * np.sin(2 * np.pi * 0.15 * t)

    there = (moment(t_s) >= 0) & (moment(t_s) <= t_s[-1])
    got = effect(effect_id).term(rich_run, 2, values)
    np.testing.assert_allclose(got[there], (swing(moment(t_s)) - swing(t_s))[there], atol=1e-4)


def test_only_misalignment_sees_the_rate_of_another_axis(make_run: MakeRun) -> None:
    run = make_run(np.arange(100) / 10, table_rate_dps=78.0, axis="x", face="down")
    ids = ("scale", "scale_nonlinearity", "scale_asymmetry", "spin_up", "scale_temperature")
    for effect_id in ids:
        kind = effect(effect_id)
        assert not np.any(kind.term(run, 2, kind.draw({}, np.random.default_rng(0))))
    kind = effect("misalignment")
    assert kind.axes(run) == (1, 2)
    np.testing.assert_allclose(kind.term(run, 2, {"m": 0.004}), 0.004 * -78.0)
    np.testing.assert_allclose(kind.term(run, 2, {"m_x": 0.004, "m_y": 0.1}), 0.004 * -78.0)
    assert not np.any(kind.term(run, 0, {"m": 0.004}))


def test_the_pull_off_the_axis_is_alike_on_every_axis_and_in_both_directions(make_run: MakeRun) -> None:
    kind, k = effect("centripetal"), 2e-6
    for rate_dps in (78.0, -78.0):
        run = make_run(np.arange(100) / 10, table_rate_dps=rate_dps, axis="x", face="down")
        for axis in range(3):
            np.testing.assert_allclose(kind.term(run, axis, {"k": k}), k * 78.0**2)


def test_warmup_between_its_limits(make_run: MakeRun) -> None:
    """Long tau: constant. Short tau: gone before the run. It goes on over the turning over of the part."""
    t_s = np.arange(300) / 10
    up, down = (make_run(t_s, power_on_s=p, face=f) for p, f in ((3.0, "up"), (33.0, "down")))
    kind = effect("warmup")
    np.testing.assert_allclose(kind.term(up, 2, {"A_dps": 0.02, "tau_s": 1e9}), 0.02, rtol=1e-7)
    assert np.max(kind.term(up, 2, {"A_dps": 0.02, "tau_s": 0.1})) < 1e-14
    both = np.concatenate([kind.term(r, 2, {"A_dps": 0.02, "tau_s": 20.0}) for r in (up, down)])
    np.testing.assert_allclose(both[1:] / both[:-1], np.exp(-0.1 / 20))


def test_drift_goes_on_over_the_turning_over_where_power_on_is_known(make_run: MakeRun) -> None:
    t_s = np.arange(300) / 10
    runs = [make_run(t_s, power_on_s=p) for p in (3.0, 33.0)]
    both = np.concatenate([effect("drift").term(r, 2, {"k_dps_per_s": 1e-3}) for r in runs])
    np.testing.assert_allclose(np.diff(both), 1e-4)
    unknown = effect("drift").term(make_run(t_s + 100), 2, {"k_dps_per_s": 1e-3})
    np.testing.assert_allclose(unknown, 1e-3 * t_s)


@pytest.mark.parametrize("tau_s", [0.01, 0.3])
def test_lag_is_what_a_delay_and_a_first_order_filter_do(tau_s: float, make_run: MakeRun) -> None:
    t_s, f_hz = np.arange(4000) / 200, 0.2
    run = make_run(t_s, rate_ref_dps=100 * np.sin(2 * np.pi * f_hz * t_s))
    delayed = 100 * np.sin(2 * np.pi * f_hz * (t_s - tau_s))
    _, filtered, _ = signal.lsim(([1.0], [tau_s, 1.0]), run.rate_dps, t_s)
    for order, reading in ((0.0, delayed), (1.0, filtered)):
        term = effect("lag").term(run, 2, {"tau_s": tau_s, "order": order})
        settled = t_s > 12 * tau_s
        np.testing.assert_allclose(term[settled], (reading - run.rate_dps)[settled], atol=2e-3)


def test_clock_error_is_the_rate_at_the_wrong_time(make_run: MakeRun) -> None:
    t_s, e = np.arange(4000) / 100, 2e-4
    w = lambda t: 80 * np.sin(2 * np.pi * 0.1 * t) + 20 * np.cos(2 * np.pi * 0.23 * t)  # noqa: E731
    run = make_run(t_s, rate_ref_dps=w(t_s))
    term = effect("clock_error").term(run, 2, {"e": e})
    np.testing.assert_allclose(term[:-2], (w((1 + e) * t_s) - w(t_s))[:-2], atol=1e-5)


def test_a_late_reading_shows_the_table_s_angle_of_that_moment_too(make_run: MakeRun) -> None:
    t_s = np.arange(1000) / 100
    rate_dps, angle_deg = 50 * np.cos(t_s), 50 * np.sin(t_s)
    run = make_run(t_s, rate_ref_dps=rate_dps, table_angle_deg=angle_deg).timed(Timing(delay_s=0.25))
    late = t_s > 0.25
    np.testing.assert_allclose(np.rad2deg(table_angle_rad(run))[late], 50 * np.sin(t_s - 0.25)[late], atol=2e-3)
    np.testing.assert_allclose(run.rate_dps[late], 50 * np.cos(t_s - 0.25)[late], atol=1e-5)


def test_constant_rates_show_neither_lag_nor_clock_error(make_run: MakeRun) -> None:
    run = make_run(np.arange(500) / 100)
    for effect_id in ("lag", "clock_error"):
        assert not np.any(effect(effect_id).columns(run, 2, {}))


def test_jittering_time_does_not_disturb_a_slope(make_run: MakeRun) -> None:
    rng = np.random.default_rng(3)
    t_s = np.sort(np.arange(3000) / 145 + rng.uniform(0, 0.003, 3000))
    run = make_run(t_s, rate_ref_dps=50 * np.sin(t_s))
    slope = effect("clock_error").columns(run, 2, {})[:, 0] / np.maximum(t_s - t_s[0], 1e-9)
    assert np.max(np.abs(slope - 50 * np.cos(t_s))[5:]) < 0.02 * 50


def test_thermal_lag_opens_a_loop(make_run: MakeRun) -> None:
    """On the way up and on the way down through one temperature: the same size, the other sign."""
    t_s = np.arange(12000) / 20
    run = make_run(t_s, temp_c=40 + 20 * np.sin(2 * np.pi * t_s / 300))
    term = effect("thermal_lag").term(run, 0, {"k_dps_s_per_c": 0.5})
    up, down = np.searchsorted(t_s, [300.0, 450.0])
    expected = 0.5 * 20 * 2 * np.pi / 300
    np.testing.assert_allclose([term[up], term[down]], [expected, -expected], rtol=0.02)


@pytest.mark.parametrize(("noise_c", "step_c"), [(0.02, 1 / 256), (0.0, 0.5), (0.1, 0.0625)])
def test_slope_of_the_temperature_with_noise_and_coarse_steps(noise_c: float, step_c: float, make_run: MakeRun) -> None:
    rng = np.random.default_rng(1)
    t_s = np.arange(6000) / 10
    true = 25 + 15 * np.sin(2 * np.pi * t_s / 600)
    measured = np.round((true + rng.normal(0, noise_c, t_s.size)) / step_c) * step_c
    slope = temperature_slope_c_s(make_run(t_s, temp_c=measured))
    want = np.gradient(true, t_s)
    assert np.sqrt(np.mean((slope - want) ** 2)) < 0.1 * np.sqrt(np.mean(want**2))


def test_slope_of_a_temperature_that_turns_within_ten_seconds(make_run: MakeRun) -> None:
    """A parabola over 10 s made the slope at the start of a ramp 0.09 degC/s too large; the thermal lag was 9 % off."""
    t_s = np.arange(1000) / 10
    angles = [2 * np.pi * k * t_s / 120 for k in (1, 3, 5)]
    true = 25 - sum(14 * 8 / (np.pi * k) ** 2 * np.cos(angle) for k, angle in zip((1, 3, 5), angles, strict=True))
    noisy = np.round((true + np.random.default_rng(1).normal(0, 0.01, t_s.size)) * 256) / 256
    slope, want = temperature_slope_c_s(make_run(t_s, temp_c=noisy)), np.gradient(true, t_s)
    assert np.max(np.abs(slope - want)[5:-5]) < 0.03


def test_a_steady_thermometer_has_no_slope(make_run: MakeRun) -> None:
    t_s = np.arange(600) / 10
    assert not np.any(temperature_slope_c_s(make_run(t_s, temp_c=25.0)))
    noisy = 25 + np.random.default_rng(0).normal(0, 0.02, t_s.size)
    assert np.max(np.abs(temperature_slope_c_s(make_run(t_s, temp_c=noisy)))) < 1e-3


def test_empty_cells_are_bridged(make_run: MakeRun) -> None:
    t_s = np.arange(300) / 10
    temp_c = np.where(np.arange(300) % 5 == 2, np.nan, 20 + 0.3 * t_s)
    frame_run = make_run(t_s, temp_c=temp_c)
    holed = make_run(t_s, temp_c=20 + 0.3 * t_s)
    for effect_id in ("bias_temperature", "scale_temperature", "thermal_lag"):
        values = effect(effect_id).draw({}, np.random.default_rng(0))
        got, want = (effect(effect_id).term(r, 2, values) for r in (frame_run, holed))
        np.testing.assert_allclose(got, want, rtol=2e-3, atol=1e-6)


def test_earth_rate() -> None:
    """One turn in a sidereal day of 86164.0905 s; full at the pole, nothing at the equator, negative in the south."""
    from .conftest import make

    t_s = np.arange(10) / 10
    up, down = make(t_s), make(t_s, face="down")
    np.testing.assert_allclose(known_dps(up, 2, 90.0), 360 / 86164.0905, rtol=1e-6)
    np.testing.assert_allclose(known_dps(up, 2, 30.0), 0.5 * 360 / 86164.0905, rtol=1e-6)
    np.testing.assert_allclose(known_dps(down, 2, 30.0), -known_dps(up, 2, 30.0))
    np.testing.assert_allclose(known_dps(up, 2, -30.0), -known_dps(up, 2, 30.0))
    assert not np.any(known_dps(up, 2, 0.0))
    assert not np.any(known_dps(up, 0, 45.0))
    assert effect("earth_rate").columns(up, 2, {}).shape == (10, 0)
    np.testing.assert_allclose(effect("earth_rate").term(up, 2, {"latitude_deg": 45.0}), known_dps(up, 2, 45.0))


@pytest.mark.parametrize("face", ["up", "down"])
@pytest.mark.parametrize(
    "known", [{"table_rate_dps": 0.0}, {"table_rate_dps": -78.0}, {"table_rate_dps": None, "turn_deg": 90.0}]
)
def test_a_known_motion_gains_what_the_sensor_reads_of_the_earth(face: str, known: dict[str, float | None]) -> None:
    from .conftest import make

    run = replace(make(np.arange(101) / 10, face=face, **known), latitude_deg=-30.0)
    np.testing.assert_allclose(in_known_rate(run).rate_dps - run.rate_dps, known_dps(run, 2, -30.0), atol=1e-12)


def test_centripetal_size_from_lever_arm_and_g_sensitivity() -> None:
    """The typical range: w^2 r in g, times dps/g, in 1/dps, from a small turntable to the arm of a centrifuge."""
    low, high = effect("centripetal").parameter("k").typical
    per_metre = np.deg2rad(1.0) ** 2 / 9.80665
    np.testing.assert_allclose([0.01 * 0.03 * per_metre, 0.1 * 1.0 * per_metre], [low, high], rtol=0.1)


def test_tone(make_run: MakeRun) -> None:
    kind = effect("vibration_tone")
    run = make_run(np.arange(2000) / 100)
    values = {"f_hz": 3.0, "A_dps": 0.02, "phase_deg": 35.0}
    assert np.std(kind.term(run, 0, values)) == pytest.approx(0.02 / np.sqrt(2), rel=1e-3)
    assert kind.columns(run, 0, {}).shape == (2000, 0)
    again = kind.coding.named(kind.coding.coefficients(values), values)
    assert again == pytest.approx({"A_dps": 0.02, "phase_deg": 35.0})
    assert kind.coding.named_spread(kind.coding.spread(values), values)["A_dps"] == pytest.approx(0.02)
    phases = {kind.draw({}, np.random.default_rng(seed))["phase_deg"] for seed in range(5)}
    assert len(phases) == 5


def test_jumps(make_run: MakeRun) -> None:
    kind = effect("bias_jumps")
    run = make_run(np.arange(5000) / 100)
    for n in (1, 2, 5):
        values = kind.draw({"n": n, "size_dps": 0.04}, np.random.default_rng(n))
        steps = np.diff(kind.term(run, 2, values))
        assert np.count_nonzero(steps) == n
        np.testing.assert_allclose(np.abs(steps[steps != 0]), 0.04)
    assert kind.term(run, 2, values)[0] == 0.0
    first_way = [kind.draw({"size_dps": 0.04}, np.random.default_rng(seed))["size_dps"] for seed in range(40)]
    assert 10 < sum(size > 0 for size in first_way) < 30  # up in one run, down in another: no drift


def distorted(effect_id: str, run: Run, y_dps: Array, **values: float) -> Array:
    kind = effect(effect_id)
    return kind.distort(run, y_dps, kind.draw(values, np.random.default_rng(0)), np.random.default_rng(4))  # type: ignore[attr-defined, no-any-return]


def test_quantization_is_a_grid_with_uniform_error(make_run: MakeRun) -> None:
    run = make_run(np.arange(20000) / 100)
    y_dps = np.random.default_rng(0).normal(0, 1.0, (20000, 3))
    got = distorted("quantization", run, y_dps, lsb_dps=0.05)
    np.testing.assert_allclose(got / 0.05, np.round(got / 0.05), atol=1e-9)
    error = got - y_dps
    assert np.max(np.abs(error)) <= 0.025 + 1e-12
    assert np.var(error) == pytest.approx(0.05**2 / 12, rel=0.02)
    assert abs(np.mean(error)) < 1e-3
    assert effect("quantization").axes(run) == (0, 1, 2)


def test_saturation_cuts_both_ends_and_nothing_else(make_run: MakeRun) -> None:
    run = make_run(np.arange(301) / 10)
    y_dps = np.repeat(np.linspace(-150, 150, 301)[:, None], 3, axis=1)
    got = distorted("saturation", run, y_dps, full_scale_dps=125.0)
    inside = np.abs(y_dps) <= 125
    np.testing.assert_array_equal(got[inside], y_dps[inside])
    np.testing.assert_array_equal(got[~inside], 125 * np.sign(y_dps[~inside]))


def test_sampling_fault_repeats_whole_samples(make_run: MakeRun) -> None:
    run = make_run(np.arange(20000) / 100)
    y_dps = np.random.default_rng(0).normal(0, 1.0, (20000, 3))
    got = distorted("sampling_fault", run, y_dps, fraction=0.03)
    repeated = np.all(got[1:] == got[:-1], axis=1)
    np.testing.assert_array_equal(repeated, np.any(got[1:] == got[:-1], axis=1))
    assert np.mean(repeated) == pytest.approx(0.03, abs=0.005)
    fresh = np.concatenate([[True], ~repeated])
    np.testing.assert_array_equal(got[fresh], y_dps[fresh])
    np.testing.assert_array_equal(distorted("sampling_fault", run, y_dps, fraction=0.0), y_dps)


@pytest.mark.parametrize("seed", range(3))
def test_a_leak_of_a_changing_rate_neither_hides_a_jump_nor_makes_one(make_run: MakeRun, seed: int) -> None:
    """On an axis across the table's, the rate leaks by a misalignment, an asymmetry and a delay."""
    rng, t_s = np.random.default_rng(seed), np.arange(2500) / 100
    rate = 60 * np.sin(2 * np.pi * t_s / rng.uniform(5, 9)) + 20 * np.sin(2 * np.pi * t_s / 3)
    leak = 5e-3 * rate + 5e-4 * np.abs(rate) + 2e-4 * np.gradient(rate, t_s)
    y = rng.normal(0, 0.03, (t_s.size, 3)) + np.outer(leak, [1, 1, 0])
    y[t_s > 14, 1] += 0.05
    run = make_run(t_s, y, rate_ref_dps=rate)
    assert jumps(run, 0) == []
    (row,) = jumps(run, 1)
    assert abs(t_s[row] - 14) < 1.0
