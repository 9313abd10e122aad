"""Noise of the reference and of the thermometer neither attenuates an estimate nor hides in its standard error."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.error_model.model import Model
from gyrocal.inference.fit import fit
from gyrocal.plausibility import check
from gyrocal.recording.header import Reference
from gyrocal.recording.run import Run
from gyrocal.recording.smoothing import NoiseLevel, Smoothed, smoothed_temperature
from known import ON_Z
from make_runs import make_run, make_session

pytestmark = pytest.mark.usefixtures("tests_alone")

RATE_HZ = 50.0
SCALE, REFERENCE_SD, GYRO_SD = 0.02, 0.1, 0.02


def weak_swing(seed, scale=SCALE, runs=4):
    """A swing of 1 deg/s at 3 Hz, which leaves no band to smooth in, with an encoder of 0.1 deg/s noise."""
    rng = np.random.default_rng(seed)
    made = []
    for i in range(runs):
        t_s = np.arange(round(60 * RATE_HZ)) / RATE_HZ
        rate = np.sin(2 * np.pi * 3 * t_s + rng.uniform(0, 6))
        gyro = rng.normal(0, GYRO_SD, (t_s.size, 3)) - 0.05
        gyro[:, 2] += (1 + scale) * rate
        reference = rate + rng.normal(0, REFERENCE_SD, t_s.size)
        made.append(make_run(t_s, gyro, rate_ref_dps=reference, scenario=f"s{i}", rate_hz=RATE_HZ))
    return make_session(*made)


def scale_of(session):
    fitted = fit(session, Model.open("paper"), axes="z").model
    line = next(line for line in fitted.lines() if line.axis == "z" and line.id == "scale")
    return line.values["scale"], line.se["scale"]


def deming(session):
    """Total least squares of one line with known ratio of the noises (Deming 1943), minus one."""
    y = np.concatenate([run.gyro_dps[:, 2] for run in session.runs])
    x = np.concatenate([run.rate_dps for run in session.runs])
    ratio = (GYRO_SD / REFERENCE_SD) ** 2
    (sxx, sxy), (_, syy) = np.cov(x, y)
    return (syy - ratio * sxx + np.hypot(syy - ratio * sxx, 2 * ratio**0.5 * sxy)) / (2 * sxy) - 1


def test_the_scale_of_a_weak_swing_is_not_attenuated():
    estimates = np.array([scale_of(weak_swing(seed)) for seed in range(12)])
    z = (estimates[:, 0] - SCALE) / estimates[:, 1]
    attenuation = REFERENCE_SD**2 / 0.5  # what least squares would lose: 2 %, twelve standard errors
    assert attenuation > 10 * estimates[:, 1].mean()
    assert abs(z.mean()) < 3 / 12**0.5
    assert 0.6 < np.sqrt(np.mean(z**2)) < 1.5


def test_the_estimate_is_that_of_total_least_squares():
    for seed in range(3):
        session = weak_swing(seed)
        value, se = scale_of(session)
        assert value == pytest.approx(deming(session), abs=1.5 * se)


def test_a_reference_that_only_shows_noise_gives_no_scale():
    rng = np.random.default_rng(5)
    t_s = np.arange(6000) / 100.0
    runs = [
        make_run(t_s, rng.normal(0, 0.04, (t_s.size, 3)), rate_ref_dps=rng.normal(0, 0.05, t_s.size), scenario=f"s{i}")
        for i in range(4)
    ]
    fitted = fit(make_session(*runs), Model.open("paper"), axes="z").model
    assert all("scale" not in line.values for line in fitted.lines() if line.id == "scale")


def jumpy(**reference):
    """A reference that moves at random from sample to sample, so that nothing tells its noise from its motion."""
    rng = np.random.default_rng(7)
    t_s = np.arange(40_000) / RATE_HZ
    rate = lfilter([1], [1, -0.8], rng.normal(0, 3.0, t_s.size))
    gyro = rng.normal(0, GYRO_SD, (t_s.size, 3))
    gyro[:, 2] += rate
    run = make_run(t_s, gyro, rate_ref_dps=rate + rng.normal(0, 0.5, t_s.size), rate_hz=RATE_HZ)
    return make_session(replace(run, reference=Reference(**reference)))


def test_the_bound_of_an_unknown_attenuation_is_told():
    (warning,) = (w for w in check(jumpy()) if w.code == "noise_unknown")
    assert not warning.blocking
    assert "at most" in warning.text
    assert "ref_noise_dps" in warning.text
    assert "noise_unknown" not in [w.code for w in check(jumpy(ref_noise_dps=0.5))]
    assert "noise_unknown" not in [w.code for w in check(weak_swing(0))]


@pytest.mark.parametrize("part", [0.4, 0.7, 0.9, 0.99])
def test_of_a_rate_that_is_mostly_noise_no_more_than_half_is_taken_out(part, monkeypatch):
    """Without its whole noise, next to nothing is left to divide by, and beside a drift less than nothing."""
    rng = np.random.default_rng(8)
    t_s = np.arange(6000) / RATE_HZ
    rate = np.sin(2 * np.pi * 0.05 * t_s) + np.sin(2 * np.pi * 0.31 * t_s)
    drift = np.cumsum(rng.normal(0, 0.01, t_s.size))
    gyro = rng.normal(0, GYRO_SD, (t_s.size, 3)) + (rate + drift)[:, None]
    noisy = Smoothed(rate, np.full(t_s.size, part), NoiseLevel(100.0, 0.1))
    monkeypatch.setattr(Run, "smooth_rate", noisy)
    value, se = scale_of(make_session(make_run(t_s, gyro, rate_ref_dps=rate, rate_hz=RATE_HZ)))
    assert abs(value) < 1.1
    assert np.isfinite(se)


def test_the_stated_noise_of_a_thermometer_is_believed():
    t_s = np.arange(60_000) / 5.0
    temp_c = 25 + np.cumsum(np.random.default_rng(3).normal(0, 0.05, t_s.size))
    assert smoothed_temperature(temp_c, t_s, 0.01).noise.uncertainty < 1
    assert smoothed_temperature(temp_c, t_s).noise.uncertainty == 1


def warm_swing(seed, planted=0.0, start_c=38.0):
    """The swing in a chamber that warms by 4 degC; ``planted`` is a change of the scale per degC."""
    rng = np.random.default_rng(seed)
    made = []
    for i, run in enumerate(weak_swing(seed, scale=0.002).runs):
        temp_c = start_c + i + np.linspace(0, 1, len(run))
        rate = (run.gyro_dps[:, 2] + 0.05) / 1.002
        gyro = run.gyro_dps + np.outer(planted * (temp_c - 25) * rate, [0, 0, 1])
        temp_c = temp_c + rng.normal(0, 0.01, temp_c.size)
        made.append(make_run(run.t_s, gyro, rate_ref_dps=run.rate_dps, temp_c=temp_c, scenario=f"s{i % 2}", rate_hz=RATE_HZ))
    return make_session(*made)


@pytest.mark.parametrize("seed", [*(pytest.param(seed, marks=pytest.mark.wide) for seed in (0, 1)), 2])
def test_noise_of_the_reference_is_in_no_other_column_that_grows_with_the_rate(seed):
    """It was taken out of the scale's column alone: the scale then seemed to change with time and temperature."""
    found = diagnose(warm_swing(seed), ON_Z)
    assert found.comparison.where == []
    assert [c.effect.id for c in found.candidates if c.decision in ("add", "suggest")] == []


def test_what_changes_the_scale_is_found_at_its_size_all_the_same():
    planted = 0.02
    of_z = {c.effect.id: c for c in diagnose(warm_swing(1, planted, start_c=23.0), ON_Z).candidates}
    found = of_z["scale_temperature"]
    assert found.gain is not None
    assert found.gain > 100
    assert found.values["k_per_c"] == pytest.approx(planted, abs=4 * found.se["k_per_c"])
    assert found.se["k_per_c"] < planted / 5
