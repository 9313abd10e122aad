"""Lines over the table's angle: their chances under noise."""

import numpy as np
import pytest

from gyrocal.noise.orders import order_spectrum


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
