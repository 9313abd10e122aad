"""Rates from the orientations of a noisy tracker: slower than the sensor, interpolated, and bad for moments."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from gyrocal.diagnosis.answer.compare import compare
from gyrocal.plausibility import check
from gyrocal.recording.angle_slopes import angle_noise_deg, angle_slopes
from gyrocal.recording.header import Reference
from gyrocal.recording.session import Session
from known import ON_Z
from make_runs import make_run, make_session

Array = NDArray[np.float64]
SENSOR_HZ, TRACKER_HZ, SECONDS = 200.0, 120.0, 60.0
NOISE_DEG, SCALE = 0.08, 0.004


def strength(t_s: Array) -> Array:
    """The part [n] of the strongest motion at times [n], s."""
    return np.asarray(0.1 + 0.9 * np.sin(np.pi * t_s / 20) ** 8)


@cache
def moved() -> tuple[Array, Array, Rotation]:
    """Times [n], s, body rates [n, 3], deg/s, and orientations in steps of 1/1200 s: by turns slow and fast."""
    rng = np.random.default_rng(5)
    t_s = np.arange(round(SECONDS * 1200)) / 1200
    f, p, a = rng.uniform(0.1, 2.5, (8, 3)), rng.uniform(0, 7, (8, 3)), rng.normal(0, 20, (8, 3))
    rates = strength(t_s)[:, None] * np.sum(a * np.sin(2 * np.pi * f * t_s[:, None, None] + p), axis=1)
    steps = Rotation.from_rotvec(np.deg2rad((rates[1:] + rates[:-1]) / 2) / 1200)
    at, out = np.array([1.0, 0, 0, 0]), np.empty((t_s.size, 4))
    for k, (x, y, z, w) in enumerate(np.vstack([steps.as_quat(), [0, 0, 0, 1]])):
        out[k] = at
        a0, a1, a2, a3 = at
        at = np.array([
            a0 * w - a1 * x - a2 * y - a3 * z, a0 * x + a1 * w + a2 * z - a3 * y,
            a0 * y - a1 * z + a2 * w + a3 * x, a0 * z + a1 * y - a2 * x + a3 * w,
        ])  # fmt: skip
    return t_s, rates, Rotation.from_quat(out[:, [1, 2, 3, 0]])


def tracked(seed: int, *, interpolated: bool, burst: float = 1.0) -> Session:
    """A sensor with a scale error, beside a tracker whose noise is ``burst`` times as large from 31 to 33 s."""
    rng = np.random.default_rng(seed)
    t_s, rates, orientation = moved()
    seen = orientation[::10]
    tracker_s = t_s[::10]
    noise_deg = NOISE_DEG * np.where((tracker_s > 31) & (tracker_s < 33), burst, 1.0)
    seen = seen * Rotation.from_rotvec(np.deg2rad(noise_deg[:, None] * rng.standard_normal((len(seen), 3))))
    at_s = t_s[::6][: round((SECONDS - 0.1) * SENSOR_HZ)]
    gyro = (1 + SCALE) * rates[::6][: at_s.size] + 0.1 * rng.standard_normal((at_s.size, 3))
    q = Slerp(tracker_s, seen)(at_s).as_quat()[:, [3, 0, 1, 2]]
    if not interpolated:  # each measurement stands in the row that is nearest to it
        rows = np.unique(np.searchsorted(at_s, tracker_s[tracker_s <= at_s[-1]]).clip(0, at_s.size - 1))
        q = np.where(np.isin(np.arange(at_s.size), rows)[:, None], q, np.nan)
    columns = {name: q[:, i] for i, name in enumerate(("ref_qw", "ref_qx", "ref_qy", "ref_qz"))}
    run = replace(make_run(at_s, gyro, table_rate_dps=None, **columns), reference=Reference())
    return make_session(run, reference=Reference())


@pytest.mark.wide
@pytest.mark.slow
@pytest.mark.parametrize("interpolated", [True, False])
def test_a_slower_tracker_gives_a_scale_without_attenuation(interpolated: bool) -> None:
    session = tracked(1, interpolated=interpolated)
    found = compare(session)
    assert found.verdict == "adequate"
    printed = found.to_json()
    assert printed["rms_dps"] < 2.5  # interpolated and differentiated, the noise alone would be 17 dps
    scales = [p for p in printed["parameters"] if p["effect"] == "scale"]
    assert len(scales) == 3
    for scale in scales:
        assert abs(scale["value"] - SCALE) < 4 * scale["se"] < 4e-3


def test_the_steadier_rate_has_the_error_that_it_says() -> None:
    _, rates, _ = moved()
    run = tracked(2, interpolated=True).runs[0]
    for k, axis in enumerate("xyz"):
        found = run.about(axis).smooth_rate
        assert found is not None
        true, seen, error = (x[run.reached] for x in (rates[::6][: len(run), k], found.values, found.error))
        slow = strength(run.t_s[run.reached]) < 0.2
        for part in (slow, ~slow):  # the motion bends within the windows, by about as much as the noise
            assert 0.7 < np.sqrt(np.mean((seen - true)[part] ** 2) / np.mean(error[part])) < 2
        assert abs(np.polyfit(seen[slow], true[slow], 1)[0] - 1) < 0.03  # a spline's slope attenuates it by a tenth and more


@pytest.mark.parametrize("samples", [1, 6, 20, 60])
def test_means_of_slopes_have_the_noise_that_they_say_in_brisk_motion_too(samples: int) -> None:
    """No line agrees with such a motion, so the spline's slope is the steadiest: its noise is there all the same."""
    rng, t_s = np.random.default_rng(6), np.arange(12_000) / 100
    f, phase = np.linspace(0.3, 2.2, 8), rng.uniform(0, 7, 8)
    angle_deg = 25 * np.sin(2 * np.pi * f * t_s[:, None] + phase).sum(axis=1, keepdims=True)
    noisy_deg = angle_deg + 0.01 * rng.standard_normal(angle_deg.shape)

    known = np.ones(t_s.size, dtype=bool)
    found = angle_slopes(t_s, known, lambda rows: np.diff(noisy_deg[rows], axis=0), steadier=True)
    true_dps = (25 * 2 * np.pi * f * np.cos(2 * np.pi * f * t_s[:, None] + phase)).sum(axis=1)
    assert found.steadier is not None
    inside = slice(60, -60)
    off, said = (found.steadier.values[:, 0] - true_dps)[inside], found.steadier.error_of_means(samples)[inside, 0]
    means = off[: off.size // samples * samples].reshape(-1, samples).mean(axis=1)
    assert 0.8 < np.sqrt(np.mean(said)) / np.std(means) < 1.4  # the noise of angles is estimated at the louder frequencies


@pytest.mark.slow
def rates_of(t_s: Array, angle_deg: Array) -> Array:
    """The rates [n] of an angle [n], NaN at its ends."""
    return angle_slopes(t_s, np.ones(t_s.size, dtype=bool), lambda rows: np.diff(angle_deg[rows])[:, None]).rates[:, 0]


@pytest.mark.parametrize("noise_deg", [0.005, 0.05])
def test_the_rates_of_a_brisk_motion_lose_nothing_of_it(noise_deg: float) -> None:
    """At the width of the least error per angle, block means lost up to a third of their noise, most at the ends."""
    t_s, off = np.arange(6_000) / 100, []
    f, phase = np.linspace(0.1, 1.2, 8), np.random.default_rng(6).uniform(0, 7, 8)
    angle_deg = 40 / f[:, None] / 2 / np.pi * np.sin(2 * np.pi * f[:, None] * t_s + phase[:, None])
    true_dps = (40 * np.cos(2 * np.pi * f[:, None] * t_s + phase[:, None])).sum(axis=0)
    for seed in range(12):
        noisy_deg = angle_deg.sum(axis=0) + noise_deg * np.random.default_rng(seed).standard_normal(t_s.size)
        off.append(rates_of(t_s, noisy_deg) - true_dps)
    found = np.array(off)[:, np.isfinite(off).all(axis=0)]
    assert found.shape[1] > 0.9 * t_s.size
    means = found[:, : found.shape[1] // 10 * 10].reshape(len(found), -1, 10).mean(axis=2)
    noise, bias = means.std(axis=0, ddof=1).mean(), means.mean(axis=0)
    assert np.mean(bias**2) < noise**2 / 12 * 1.3  # no more than the mean of twelve noises
    assert noise < 0.5 * 2**0.5 * noise_deg / 0.1  # that of two angles


@pytest.mark.wide
def test_moments_in_which_a_tracker_is_noisy_are_told_and_left_out() -> None:
    session = tracked(3, interpolated=True, burst=8.0)
    measured = session.runs[0].measured_rates
    assert measured is not None
    assert measured.noisy is not None
    t_s = session.runs[0].t_s
    assert measured.noisy[(t_s > 31.2) & (t_s < 32.8)].all()
    assert not measured.noisy[(t_s < 30.8) | (t_s > 33.2)].any()
    assert [w.code for w in check(session)] == ["reference_jumps"]
    assert "in one stretch (at 3" in check(session)[0].text
    assert compare(session, ON_Z).verdict == "adequate"


def test_the_noise_of_jittered_stamps_in_motion_is_no_reason_to_leave_the_motion_out() -> None:
    """Stamps that are off by a millisecond add an angle where the sensor turns and none in the rests."""
    even_s, rng = np.arange(9_000) / 100, np.random.default_rng(8)
    moving = np.floor(even_s / 3) % 4 == 2
    waves = (60 * np.sin(2 * np.pi * f * even_s + p) for f, p in zip((0.3, 0.5, 0.8, 1.1), rng.uniform(0, 6, 4), strict=True))
    angle_deg = np.cumsum(moving * sum(waves)) / 100 + rng.normal(0, 2e-3, even_s.size)
    t_s = even_s + rng.uniform(-1e-3, 1e-3, even_s.size)
    found = angle_slopes(t_s, np.ones(t_s.size, dtype=bool), lambda rows: np.diff(angle_deg[rows])[:, None])
    left_deg = np.abs(found.left_deg[:, 0])
    assert np.nanmedian(left_deg[moving]) > 5 * np.nanmedian(left_deg[~moving])
    assert not found.noisy().any()


def test_angles_that_are_quiet_at_rest_and_noisy_in_every_motion_are_kept() -> None:
    """Interpolated angles have no noise at rest. A fast turn had most of the power, and the slower ones were left out."""
    t_s, rng = np.arange(9_000) / 100, np.random.default_rng(8)
    slow, fast = np.floor(t_s / 3) % 5 == 2, np.floor(t_s / 3) % 10 == 8
    rate_dps = np.where(fast, 400.0, np.where(slow, 40.0, 0.0)) * np.sin(2 * np.pi * t_s / 3)
    noise_deg = rng.normal(0, 1, t_s.size) * np.where(fast, 2.5e-3, np.where(slow, 5e-3, 1e-3))
    angle_deg = np.cumsum(rate_dps) / 100 + noise_deg
    found = angle_slopes(t_s, np.ones(t_s.size, dtype=bool), lambda rows: np.diff(angle_deg[rows])[:, None])
    assert not found.noisy().any()


@pytest.mark.parametrize("every", [1, 2, 5])
def test_the_noise_of_interpolated_angles_is_that_of_the_measured_ones(every: int) -> None:
    rng = np.random.default_rng(0)
    t_s = np.arange(12_000) / 200
    angle_deg = np.interp(t_s, t_s[::every], 0.1 * rng.standard_normal(t_s[::every].size))
    angle_deg += 100 * np.sin(2 * np.pi * 0.3 * t_s)
    assert angle_noise_deg(t_s, angle_deg) == pytest.approx(0.1 * every**0.5, rel=0.35)
