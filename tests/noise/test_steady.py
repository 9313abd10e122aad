"""What windows differ by beyond their noise, and the drift within a run, against closed forms."""

import numpy as np
import pytest

from gyrocal.noise.steady import shrunk
from gyrocal.noise.whitening import Noise


@pytest.mark.parametrize("k", [2, 6, 40])
def test_shrinking_keeps_the_part_of_the_variance_that_noise_does_not_explain(k: int) -> None:
    values = np.random.default_rng(k).normal(0, 3.0, k)
    values -= values.mean()
    variance = 0.05 * float(np.var(values, ddof=1))
    np.testing.assert_allclose(shrunk(values, variance), 0.95 * values, rtol=1e-12)


def test_equal_windows_are_shrunk_to_nothing() -> None:
    rng = np.random.default_rng(1)
    alarms = 0
    for _ in range(300):
        values = rng.normal(0, 1.0, 20)
        alarms += bool(shrunk(values - values.mean(), 1.0).any())
    assert alarms <= 3  # 4 standard errors, and a chi-square with 19 degrees of freedom: one in 1400
    assert not shrunk(np.array([5.0]), 1.0).any()


@pytest.mark.parametrize("seconds", [0.5, 20.0, 300.0])
def test_the_drift_within_a_run_is_what_its_mean_leaves_of_it(seconds: float) -> None:
    """The mean of the covariance over all pairs of moments is the variance of the mean."""
    noise = Noise(0.04, 0.003, 20.0)
    t_s = (np.arange(3000) + 0.5) * seconds / 3000
    covariance = 0.003**2 * np.exp(-np.abs(t_s[:, None] - t_s) / 20.0)
    assert noise.drift_within(seconds) == pytest.approx(0.003**2 - float(covariance.mean()), rel=1e-3)
