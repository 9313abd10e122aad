"""The chance that the noise's own tail makes outliers."""

import numpy as np
import pytest

from gyrocal import tails
from gyrocal.recording import tail
from gyrocal.recording.outliers import between
from gyrocal.recording.tail import chance_of

LSB_DPS, WHITE_DPS = 0.00875, 0.04


def noise(freedom: float, seed: int, n: int = 20_000) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return WHITE_DPS * (rng.normal(size=n) if np.isinf(freedom) else rng.standard_t(freedom, n))


def rounded(y: np.ndarray) -> np.ndarray:
    return np.rint(y / LSB_DPS) * LSB_DPS


@pytest.mark.parametrize("freedom", [3.0, 5.0, 10.0])
def test_deviations_from_neighbours_are_distributed_as_computed(freedom: float) -> None:
    """Kolmogorov's distance of 200 000 deviations from the computed distribution, below eight spreads."""
    y = np.random.default_rng(1).standard_t(freedom, 200_000)
    size = np.abs(y - between(y))
    cdf = tail._of_deviations()[0][:, list(tail.FREEDOMS).index(freedom)]
    found = np.searchsorted(np.sort(size / (tails.ROBUST * np.median(size))), tail.EDGES) / size.size
    assert np.abs(found - cdf).max() < 0.003


@pytest.mark.parametrize("freedom", [3.0, 5.0, np.inf])
def test_heavy_tails_are_no_fault(freedom: float) -> None:
    chances = [chance_of([rounded(noise(freedom, seed))], LSB_DPS) for seed in range(40)]
    assert min(chances) > 1e-3


@pytest.mark.parametrize(("freedom", "size"), [(np.inf, 0.6), (5.0, 3.0)])
def test_three_readings_far_beyond_the_tail_are_a_fault(freedom: float, size: float) -> None:
    for seed in range(5):
        y = noise(freedom, seed)
        y[[3000, 9000, 15_000]] += size
        assert chance_of([rounded(y)], LSB_DPS) < 1e-3


def test_one_reading_is_no_fault_however_far_it_lies() -> None:
    y = noise(5.0, 7)
    y[5000] = 60 * WHITE_DPS
    assert chance_of([rounded(y)], LSB_DPS) > 0.05
