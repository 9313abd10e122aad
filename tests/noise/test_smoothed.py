"""A filter before the writing of readings is as long as it is, whatever drifts beside it, and its noise is no misfit."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gyrocal.diagnosis.answer.compare import compare
from gyrocal.error_model.model import Model
from gyrocal.noise.smoothed import LONGEST, smoothed_over
from make_runs import make_run, make_session

Array = NDArray[np.float64]
HANN = np.hanning(9)[1:-1]


def filtered(weights: Array, n: int, rng: np.random.Generator) -> Array:
    return np.convolve(rng.normal(0, 1, n + weights.size - 1), weights / weights.sum(), "valid")


@pytest.mark.parametrize("wander", [0.0, 0.05])
@pytest.mark.parametrize("samples", [2, 5, 16, 40])
def test_a_running_mean_has_its_length(samples: int, wander: float) -> None:
    rng = np.random.default_rng(samples)
    readings = [
        filtered(np.ones(samples), 4000, rng) + wander / samples * np.cumsum(rng.normal(0, 1, 4000)) for _ in range(2)
    ]
    assert smoothed_over(readings) == samples


@pytest.mark.parametrize("what", ["white", "wander", "wave", "steps"])
def test_what_is_no_filter_shows_none(what: str) -> None:
    t = np.arange(4000)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        noise = rng.normal(0, 1, t.size)
        beside = {"white": 0.0, "wander": np.cumsum(rng.normal(0, 1, t.size)), "wave": 3 * np.sin(0.4 * t), "steps": t // 900}
        assert smoothed_over([noise + beside[what]]) == 1


def test_few_samples_show_none() -> None:
    assert smoothed_over([filtered(np.ones(5), 4 * LONGEST, np.random.default_rng(0))]) == 1


@pytest.mark.parametrize("samples", [1030, 1500, 3000])
def test_a_tone_that_hides_all_correlation_shows_none(samples: int) -> None:
    """Its errors exceeded the correlation at no delay, and compare ended with an IndexError."""
    t = np.arange(samples)
    for seed in range(5):
        assert smoothed_over([20 * np.sin(1.49 * t) + np.random.default_rng(seed).normal(0, 1, samples)]) == 1


def test_slowly_sampled_readings_behind_a_filter_fit_and_the_floor_is_their_rms() -> None:
    """Seven samples at 10 Hz, as a logger writes that smooths. As single readings, they looked like a misfit of 18 sigma."""
    runs = []
    rng = np.random.default_rng(3)
    for k in range(4):
        t_s = np.arange(8000) / 10
        gyro = np.column_stack([0.06 * filtered(HANN, t_s.size, rng) for _ in range(3)])
        runs.append(make_run(t_s, gyro + rng.normal(0, 0.05, 3), table_rate_dps=0.0, scenario=f"s{k}", rate_hz=10.0))
    found: Any = compare(make_session(*runs), Model.builtin("default"))
    assert found.verdict == "adequate"
    for axis in found.per_axis.values():
        assert axis.floor_dps <= axis.rms_dps + 2 * axis.excess_se_dps
        assert axis.floor_dps == pytest.approx(axis.rms_dps, rel=0.05)
