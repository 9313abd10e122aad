"""Lines over the table's angle: their chances under noise."""

import numpy as np
import pytest

from gyrocal.noise.orders import OrderPeak, order_spectrum


@pytest.mark.parametrize("spread", [0.0, 1.0], ids=["one level", "levels of runs that differ up to three times"])
def test_noise_makes_a_line_as_often_as_its_chance_says(spread: float) -> None:
    rng = np.random.default_rng(8)
    turns = np.arange(2000) * 78 / 360 / 100
    chances = []
    for _ in range(150):
        levels = np.exp(spread * rng.uniform(-1.1, 1.1, 12))
        (peak,) = order_spectrum([rng.normal(0, level, turns.size) for level in levels], [turns] * 12).peaks(1)
        chances.append(peak.chance)
    assert np.count_nonzero(np.array(chances) < 0.05) <= 16  # 7.5 are expected; more are drawn with a chance of 0.3 %


def test_a_line_in_quiet_runs_is_seen_beside_noisy_ones() -> None:
    rng = np.random.default_rng(3)
    turns = np.arange(2000) * 78 / 360 / 100
    runs = [rng.normal(0, level, turns.size) + 0.2 * np.cos(2 * np.pi * 7 * turns) for level in [1.0] * 6 + [8.0] * 6]
    (peak,) = order_spectrum(runs, [turns] * 12).peaks(1)
    assert (peak.whole, peak.chance < 1e-6) == (7, True)


@pytest.mark.parametrize("hz", [23.0, 31.7, 60.0])
def test_a_vibration_beyond_the_highest_order_makes_no_line_of_another_order(hz: float) -> None:
    """A vibration of 23 Hz on a table of 78 dps is order 106; it showed as "exactly 51 per turn" at 145 samples a second."""
    rng = np.random.default_rng(14)
    t_s = np.arange(2900) / 145
    runs = [rng.normal(0, 0.045, t_s.size) + 0.3 * np.sin(2 * np.pi * hz * t_s + phase) for phase in range(18)]
    (peak,) = order_spectrum(runs, [t_s * 78 / 360] * 18).peaks(1)
    assert peak.chance > 1e-3


@pytest.mark.parametrize("order", [1.0, 7.0, 33.5, 60.0])
def test_the_amplitude_of_a_line_is_that_of_least_squares(order: float) -> None:
    turns = np.arange(5000) * 0.007 + 0.001 * np.sin(np.arange(5000))
    y = 0.3 * np.cos(2 * np.pi * order * turns + 1.0)
    found = order_spectrum([y], [turns])
    k = int(np.argmin(np.abs(found.order - order)))
    columns = np.column_stack([np.cos(2 * np.pi * found.order[k] * turns), np.sin(2 * np.pi * found.order[k] * turns)])
    expected = np.hypot(*np.linalg.lstsq(columns, y - y.mean(), rcond=None)[0])
    assert np.sqrt(found.power[k]) == pytest.approx(expected, rel=0.02)


def test_the_strongest_lines_are_the_tops_of_the_spectrum_strongest_first() -> None:
    turns = np.arange(6000) * 0.005
    y = 0.3 * np.cos(2 * np.pi * 3.4 * turns) + 0.2 * np.sin(2 * np.pi * 7 * turns)
    found = order_spectrum([y + np.random.default_rng(1).normal(0, 0.02, turns.size)], [turns])
    tops = found.peaks(3)
    apart = np.abs(found.order - 3.4) > 1
    assert tops[0].amplitude_dps == pytest.approx(np.sqrt(found.power.max()))
    assert tops[0].order == found.order[np.argmax(found.power)] == pytest.approx(3.4, abs=tops[0].resolution / 2)
    (second,) = (p for p in tops if p.whole == 7)
    assert second.order == found.order[apart][np.argmax(found.power[apart])]


@pytest.mark.parametrize(
    ("order", "resolution", "whole"),
    [(2.004, 0.05, 2), (1.97, 0.05, None), (2.4, 0.1, None), (0.01, 0.1, None), (0.6, 1.0, 1)],
)
def test_an_order_is_whole_within_half_its_resolution(order: float, resolution: float, whole: int | None) -> None:
    assert OrderPeak(order, 0.1, 0.0, resolution).whole == whole
