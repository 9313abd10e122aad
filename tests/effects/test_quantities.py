"""What effects compute of a run's columns."""

import numpy as np
import pytest

from gyrocal.effects.base import in_one_power_cycle
from gyrocal.effects.quantities import cosines, from_seconds, means_of_tenths, temperature_by_second, unit_wave
from make_runs import make_run


@pytest.mark.parametrize("n", [1, 7, 10, 11, 99, 870])
def test_the_tenths_of_a_run_are_even_and_hold_each_sample_once(n: int) -> None:
    edges = [0.0]
    for middle in means_of_tenths(np.arange(float(n))[:, None])[:, 0]:  # the mean of a part of 0, 1, 2 ... is its middle
        edges.append(2 * middle + 1 - edges[-1])
    sizes = np.diff(edges)
    assert edges[-1] == n
    assert sizes.size == min(n, 10)
    assert np.ptp(sizes) <= 1


def test_cosines_by_recurrence_are_those_of_the_angle() -> None:
    part = np.linspace(0, 1, 1001)
    exact = np.cos(np.pi * np.arange(1, 13)[:, None] * part)
    assert np.abs(cosines(part, 12) - exact).max() < 1e-12


def test_a_unit_wave_is_the_complex_exponential() -> None:
    angle = np.linspace(-300, 300, 1001)
    assert np.abs(unit_wave(angle) - np.exp(1j * angle)).max() < 1e-12


@pytest.mark.parametrize("seconds", [0.5, 1.5, 40.0])
def test_values_of_seconds_are_at_samples_what_linear_interpolation_makes_of_them(seconds: float) -> None:
    rng = np.random.default_rng(1)
    t_s = np.sort(rng.uniform(0, seconds, round(30 * seconds)))
    run = make_run(t_s, rate_hz=30.0, temp_c=25 + 0.1 * t_s)
    known_s = temperature_by_second(run)[0]
    values = rng.normal(size=known_s.size)
    assert np.abs(from_seconds(run, values) - np.interp(run.t_s, known_s, values)).max() < 1e-12


@pytest.mark.parametrize(
    ("power_on_s", "scenarios", "one"),
    [((None, None), "aa", True), ((None, None), "ab", False), ((3.0, None), "ab", True), ((3.0, 9.0), "ab", False)],
)
def test_runs_of_one_power_cycle_cannot_show_that_anything_repeats(
    power_on_s: tuple[float | None, float | None], scenarios: str, one: bool
) -> None:
    """The runs that know their time since power-on count, and all of them where none does."""
    runs = [
        make_run(np.arange(100) / 100, scenario=scenario, power_on_s=known)
        for scenario, known in zip(scenarios, power_on_s, strict=True)
    ]
    assert in_one_power_cycle(runs) is one
