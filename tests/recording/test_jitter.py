"""Stamps that jitter beside measured orientations: the motion tells whether the sampling or the stamping was uneven."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gyrocal.recording.session import Session
from make_runs import make_run, make_session

Array = NDArray[np.float64]
RATE_HZ, JITTER = 200.0, 0.03
AXIS = np.array([2.0, -1.0, 2.0]) / 3


def angle_deg(t_s: Array) -> Array:
    """A brisk motion about one axis: the angle [n] at times [n], s."""
    return np.asarray(50 * np.sin(2 * np.pi * 0.5 * t_s) + 20 * np.sin(2 * np.pi * 1.3 * t_s))


def rate_dps(t_s: Array) -> Array:
    """Its rate [n], deg/s."""
    return np.asarray(
        np.pi * 50 * np.cos(2 * np.pi * 0.5 * t_s) + 2.6 * np.pi * 20 * np.cos(2 * np.pi * 1.3 * t_s)
    )


def recorded(stamped_s: Array, sampled_s: Array) -> Session:
    """A sensor beside a tracker, both sampled at the same times, with the stamps that the file has."""
    noise = np.random.default_rng(4)
    turned = Rotation.from_rotvec(np.deg2rad(angle_deg(sampled_s))[:, None] * AXIS)
    turned = turned * Rotation.from_rotvec(np.deg2rad(0.003) * noise.standard_normal((sampled_s.size, 3)))
    x, y, z, w = turned.as_quat().T
    sign = np.where(noise.random(sampled_s.size) < 0.5, -1.0, 1.0)  # either stands for the same orientation
    gyro_dps = rate_dps(sampled_s)[:, None] * AXIS + 0.1 * noise.standard_normal((sampled_s.size, 3))
    columns = {"ref_qw": sign * w, "ref_qx": sign * x, "ref_qy": sign * y, "ref_qz": sign * z}
    return make_session(make_run(stamped_s, gyro_dps, table_rate_dps=None, **columns))


def times() -> tuple[Array, Array]:
    """Even times [n], s, and the same with a jitter of a part of the interval."""
    even_s = np.arange(8000) / RATE_HZ
    return even_s, even_s + np.random.default_rng(3).normal(0, JITTER / RATE_HZ, even_s.size)


def test_of_an_even_sampler_with_jittered_stamps_the_jitter_is_left_out() -> None:
    even_s, jittered_s = times()
    run = recorded(jittered_s, even_s).runs[0]
    off_s = run.sample_s - even_s
    assert np.std(off_s) < 0.02 * JITTER / RATE_HZ
    true_dps = rate_dps(even_s)
    wrong_dps = np.abs(run.about("x").rate_dps - AXIS[0] * true_dps)[100:-100]
    assert np.quantile(wrong_dps, 0.95) < 0.1  # 0.15 ms of jitter at up to 300 deg/s would be 0.5 dps and more


@pytest.mark.parametrize("of", [lambda even_s, uneven_s: (uneven_s, uneven_s), lambda even_s, uneven_s: (even_s, even_s)])
def test_right_stamps_stay_as_they_are(of: Callable[[Array, Array], tuple[Array, Array]]) -> None:
    """An uneven sampler whose stamps tell it, and an even one."""
    stamped_s, sampled_s = of(*times())
    run = recorded(stamped_s, sampled_s).runs[0]
    assert np.array_equal(run.sample_s, run.t_s)


def test_at_rest_nothing_tells_and_the_stamps_stay() -> None:
    even_s, jittered_s = times()
    run = recorded(jittered_s, np.zeros_like(even_s)).runs[0]
    assert np.array_equal(run.sample_s, run.t_s)
