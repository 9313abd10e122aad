"""Noise of a measured column is estimated above the band of the motion and taken out; the motion stays."""

import numpy as np
import pytest

from gyrocal.recording.smoothing import NoiseLevel, Smoothed, noise_level, smoothed, smoothed_temperature

RATE_HZ = 100.0


def seconds(length_s: float, rate_hz: float = RATE_HZ) -> np.ndarray:
    return np.arange(round(length_s * rate_hz)) / rate_hz


@pytest.mark.parametrize("frequency_hz", [0.2, 1.0, 3.0, 10.0])
@pytest.mark.parametrize("sd", [0.02, 0.05])
def test_a_swing_keeps_its_amplitude_and_the_noise_is_estimated(frequency_hz, sd):
    t_s = seconds(60)
    wave = np.sin(2 * np.pi * frequency_hz * t_s)
    found = smoothed(30 * wave + np.random.default_rng(0).normal(0, sd, t_s.size))
    assert found.noise.estimated
    assert found.noise.sd == pytest.approx(sd, rel=0.2)
    assert found.values @ wave / (wave @ wave) == pytest.approx(30.0, rel=1e-3)


@pytest.mark.parametrize("count_dps", [0.0, 0.01, 0.05])
def test_plateaus_are_averaged_and_their_edges_stay(count_dps):
    rng = np.random.default_rng(1)
    steps = np.repeat([0.0, 30.0, -30.0, 78.0, 10.0], 1000)
    measured = steps + rng.normal(0, 0.05, steps.size)
    if count_dps:
        measured = np.round(measured / count_dps) * count_dps
    found = smoothed(measured)
    error = found.values - steps
    assert np.std(error) < 0.25 * 0.05
    assert np.mean(error**2) == pytest.approx(np.mean(found.error), rel=0.6)
    assert np.abs(error).max() < 5 * 0.05


def test_the_variance_told_is_that_of_the_error():
    t_s = seconds(60)
    truth = 20 * np.sin(2 * np.pi * 0.5 * t_s)
    errors, told = [], []
    for seed in range(20):
        found = smoothed(truth + np.random.default_rng(seed).normal(0, 0.05, t_s.size))
        errors.append(np.mean((found.values - truth) ** 2))
        told.append(np.mean(found.error))
    assert np.mean(told) == pytest.approx(np.mean(errors), rel=0.35)


def test_a_column_without_noise_is_left_as_it_is():
    constant = np.full(500, 78.0)
    assert np.array_equal(smoothed(constant).values, constant)
    swing = 50 * np.sin(2 * np.pi * 0.7 * seconds(20))
    assert np.abs(smoothed(swing).values - swing).max() < 1e-3


def test_motion_up_to_half_the_sampling_rate_leaves_only_a_bound():
    rng = np.random.default_rng(2)
    walk = np.cumsum(rng.normal(0, 1.0, 20_000))
    level = noise_level(walk)
    assert not level.estimated
    assert smoothed(walk, stated_sd=0.03).noise.sd == 0.03
    assert smoothed(np.zeros(1000) + rng.normal(0, 0.1, 1000), stated_sd=0.03).noise.sd == pytest.approx(0.1, rel=0.2)


def test_held_readings_count_once():
    rng = np.random.default_rng(3)
    slow = 10 * np.sin(2 * np.pi * 0.1 * seconds(60, 10.0)) + rng.normal(0, 0.05, 600)
    held = smoothed(np.repeat(slow, 10))
    assert held.noise.sd == pytest.approx(0.05, rel=0.25)
    assert np.array_equal(held.values, np.repeat(smoothed(slow).values, 10))


@pytest.mark.parametrize(("sd_c", "count_c"), [(0.03, 0.0), (0.02, 1 / 256), (0.0, 0.125), (0.03, 0.125)])
def test_a_thermometer_on_a_ramp(sd_c, count_c):
    t_s = seconds(60)
    truth = 25 + 2 * t_s / 60
    measured = truth + np.random.default_rng(4).normal(0, sd_c, t_s.size)
    if count_c:
        measured = np.round(measured / count_c) * count_c
    found = smoothed_temperature(measured, t_s)
    assert np.std(found.values - truth) < 0.004
    assert np.std(measured - truth) > 0.015


@pytest.mark.parametrize("rate_hz", [50.0, 145.0])
def test_starts_and_stops_of_a_turn_by_hand_are_no_noise(rate_hz):
    """The kink at each start reaches through the whole band: a noise of 0.01 dps was taken for 0.14 dps and smoothed away."""
    t_s = seconds(25, rate_hz)
    rng = np.random.default_rng(4)
    hand = np.zeros(t_s.size)
    for start_s in np.arange(1.0, 23.0, 3.1):
        hand += rng.uniform(20, 80) * np.sin(np.pi * np.clip((t_s - start_s) / 2.4, 0, 1)) ** 2
    found = smoothed(hand + rng.normal(0, 0.01, t_s.size))
    assert found.noise.sd == pytest.approx(0.01, rel=0.5)
    assert np.std(found.values - hand) < 0.012


@pytest.mark.parametrize("count_dps", [0.02, 0.05])
@pytest.mark.parametrize("sd_dps", [0.02, 0.03, 0.05])
def test_the_noise_of_coarse_counts_beside_ramps_is_no_whole_count(sd_dps, count_dps):
    """A median of coarse differences is a whole count: noise of 0.03 dps was taken for 0.017 dps, and moved the rests."""
    rng = np.random.default_rng(6)
    goal = np.repeat([0.0, 15.0, 30.0, 60.0, 30.0, 15.0] * 6, 300)
    rate_dps = goal.copy()
    for k in range(1, goal.size):
        rate_dps[k] = rate_dps[k - 1] + np.clip(goal[k] - rate_dps[k - 1], -2.0, 2.0)
    measured_dps = np.round((rate_dps + rng.normal(0, sd_dps, goal.size)) / count_dps) * count_dps
    found = smoothed(measured_dps)
    assert found.noise.sd == pytest.approx(np.std(measured_dps - rate_dps), rel=0.2)
    rest = rate_dps == 0
    assert np.mean(found.at_rest().values[rest] == 0) > 0.97


@pytest.mark.parametrize("held", [160, 37])
def test_set_points_are_no_noise_where_the_sensor_follows_them(held: int) -> None:
    """Steps were taken for noise of 100 deg/s, which hid the whole run as a rest."""
    rng = np.random.default_rng(held)
    points = np.repeat(rng.choice([-150.0, -78.0, -30.0, 0.0, 30.0, 78.0, 150.0], 60), held)
    gyro = 1.004 * points + 0.3 + rng.normal(0, 0.05, points.size)
    found = smoothed(points, None, gyro)
    assert found.noise.sd < 0.1
    assert np.abs(found.values - points).max() < 0.3


@pytest.mark.parametrize("repeats", [1, 10])
def test_the_noise_of_a_reference_is_not_bounded_by_a_better_sensor(repeats: int) -> None:
    rng = np.random.default_rng(repeats)
    t_s = np.arange(0, 200, 0.01 * repeats)
    true = 78 * np.sin(0.3 * t_s)
    measured = np.repeat(true + rng.normal(0, 0.4, t_s.size), repeats)
    gyro = np.repeat(true, repeats) + rng.normal(0, 0.05, measured.size)
    alone, beside = smoothed(measured), smoothed(measured, None, gyro)
    assert beside.noise.sd == pytest.approx(alone.noise.sd)
    assert beside.noise.estimated


def test_the_noise_of_slopes_of_an_orientation_is_at_most_what_the_readings_leave() -> None:
    """A robot that is seen at 5 Hz turns as fast as that shows, and its odometry had a noise of 9 deg/s: all of its motion."""
    rng = np.random.default_rng(0)
    true = rng.normal(0, 11, 600)
    found = Smoothed(true, np.full(600, 70.0), NoiseLevel(9.0, 0.5), np.full(600, 1.0))
    bounded = found.at_most(0.97 * true + rng.normal(0, 2, 600))
    assert np.mean(bounded.error) == pytest.approx(2.06**2, rel=0.2)
    assert not bounded.noise.estimated
    assert found.at_most(rng.normal(0, 0.1, 600)) is found
