"""Means in bins stand where their data are, with errors that allow for what differs between recordings."""

import numpy as np
import pytest

from gyrocal.present.bins import binned, cells, plateaus


def test_bins_are_means_with_their_errors() -> None:
    rng = np.random.default_rng(2)
    x, y = rng.uniform(0, 10, 5000), rng.normal(3.0, 0.5, 5000)
    centre, mean, error, low, high, _ = binned(x, y, 10)
    edges = np.linspace(x.min(), x.max(), 11)
    for k in range(10):
        inside = (x >= edges[k]) & ((x < edges[k + 1]) | (k == 9))
        assert centre[k] == pytest.approx(x[inside].mean())
        assert (low[k], high[k]) == pytest.approx((edges[k], edges[k + 1]))
        assert mean[k] == pytest.approx(y[inside].mean())
        assert error[k] == pytest.approx(y[inside].std(ddof=1) / np.sqrt(inside.sum()))


def test_bins_leave_out_what_is_missing_and_what_is_empty() -> None:
    centre, mean, *_ = binned(np.array([0.0, 1.0, np.nan, 10.0]), np.array([1.0, 3.0, 9.0, np.nan]), 5)
    assert mean.tolist() == [1.0, 3.0]
    assert centre.size == 2
    assert binned(np.array([np.nan]), np.array([1.0]), 5)[0].size == 0
    assert binned(np.array([2.0, 2.0]), np.array([1.0, 3.0]), 5)[1].tolist() == [2.0]


def test_means_of_two_values_stand_at_these_values() -> None:
    """A face is +1 or -1, in all runs and in each: a dot beside these values would be a face that does not exist."""
    face, y = np.repeat([-1.0, 1.0], 30), np.arange(60.0)
    assert binned(face, y, 48).centre.tolist() == [-1.0, 1.0]
    assert binned(face[:30], y[:30], 48).centre.tolist() == [-1.0]
    assert binned(face[30:], y[30:], 48).centre.tolist() == [1.0]


def test_a_mean_stands_where_its_data_are() -> None:
    """Poses of -1, 0 and 1 g with noise, in 48 bins: dots stood at the middles of bins, up to 20 mg beside the poses."""
    rng = np.random.default_rng(8)
    x = np.repeat([-1.0, 0.0, 1.0], 400) + rng.normal(0, 1e-3, 1200)
    found = binned(x, x, 48)
    assert found.centre == pytest.approx(found.mean, abs=1e-12)
    of_runs = binned(x, x, 48, np.repeat([0, 1, 2], 400)).of_runs
    assert of_runs.shape == (3, found.centre.size)  # the recordings' bins are those of all
    assert np.isfinite(of_runs).sum(axis=1).max() <= 2


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_errors_of_means_hold_for_recordings_with_offsets(seed: int) -> None:
    """The band was that of the samples alone: 0.6 mdps where recordings scattered by 5."""
    rng = np.random.default_rng(seed)
    z = []
    for _ in range(200):
        run = np.repeat(np.arange(24), 60)
        place = np.repeat(np.arange(24) % 6, 60)
        y = rng.normal(0, 5, 24)[run] + rng.normal(0, 2, run.size)
        found = cells(place, y, run, 6)
        z.append(found.mean / found.se)
    assert 0.95 < np.std(z) < 1.2  # with some 9 degrees of freedom in all, 1.13


def test_without_offsets_the_error_is_that_of_the_noise() -> None:
    rng = np.random.default_rng(4)
    run, place = np.repeat(np.arange(24), 600), np.tile(np.arange(6), 2400)
    found = cells(place, rng.normal(0, 2, run.size), run, 6)
    assert np.median(found.se) == pytest.approx(2 / 2400**0.5, rel=0.3)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_plateau_is_one_bin_and_a_ramp_has_none(seed: int) -> None:
    """The border of two equal bins at -78.1 dps parted the recordings at -78 dps, and a line joined the two parts."""
    rng = np.random.default_rng(seed)
    levels = np.array([-150.0, -78.0, -30.0, 0.0, 30.0, 78.0, 150.0])
    rate_dps = np.repeat(levels, 200) * (1 + 2e-3 * rng.standard_normal(1400))
    edges = plateaus(rate_dps)
    assert edges is not None
    assert np.histogram(rate_dps, edges)[0].tolist() == [200] * 7
    assert binned(rate_dps, rate_dps, 48).centre == pytest.approx(levels, abs=0.2)
    assert plateaus(rng.uniform(-150, 150, 1400)) is None
    assert plateaus(np.concatenate([rate_dps, np.linspace(0, 30, 100)])) is None


def test_a_wave_within_the_recordings_does_not_hide_their_scatter() -> None:
    """A ripple made the samples scatter so much that six means which differ by 4 mdps had an error of 0.15."""
    t = np.arange(400)
    wave = np.concatenate([[100 * np.cos(2 * np.pi * t / 100 + i) for i in range(6)], np.zeros((6, 400))]).ravel()
    run, place = np.repeat(np.arange(12), 400), np.repeat([0, 1], 2400)
    offsets = np.random.default_rng(6).normal(0, 4, 12)
    se = cells(place, wave + offsets[run], run, 2).se
    assert se == pytest.approx([np.std(o, ddof=1) / 6**0.5 for o in (offsets[:6], offsets[6:])], rel=0.3)
