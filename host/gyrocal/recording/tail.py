"""The tail of the noise: how probable it is that outliers are ordinary noise of a heavy-tailed kind."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from gyrocal import tails
from gyrocal.policy import POLICY
from gyrocal.recording.outliers import NEIGHBOURS, STANDS_OUT, between, outliers, spread_of
from gyrocal.recording.session import Array
from gyrocal.recording.smoothing import convolved

EDGES = np.linspace(0.0, STANDS_OUT, 161)
FREEDOMS = np.array([1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 8.0, 10.0, 14.0, 20.0, 40.0, 100.0, 1e6])
LEVELS = 5
"""Sizes at which outliers are counted, each twice the one before."""
REPEATED = 2
"""So many outliers of a size, at the least, are a fault. The largest of heavy-tailed noise has no upper limit."""
GRID = 5000
"""Points on either side of zero at which densities are computed, up to 100 scales."""
BESIDE = np.array([-3, -2, -1, 1, 2, 3])
"""Neighbours within the reach of the filters that find outliers."""


def chance_of(residuals: Sequence[Array], step_dps: float) -> float:
    """Probability that the noise of these residuals [n] itself, with the tail that it has, produces their outliers.

    Noise is Student's t, and what it has beyond ``STANDS_OUT`` spreads is expected from what it has below: the likelihood of a
    t distribution truncated there gives the degrees of freedom, of which the fewest that the data allow count. An outlier
    beside other large deviations belongs to a burst of interference and does not count.
    """
    from scipy.ndimage import median_filter

    histogram, samples, large, sizes = np.zeros(EDGES.size - 1), 0, 0, []
    for y_dps in residuals:
        if y_dps.size < 3 * NEIGHBOURS:
            continue
        level = y_dps - between(y_dps)
        spread = spread_of(level, y_dps - median_filter(y_dps, NEIGHBOURS, mode="nearest"), step_dps)
        if spread <= 0:
            continue
        samples += y_dps.size
        z = np.abs(level) / spread
        large += int(np.count_nonzero((z > POLICY.large_spreads) & (z < STANDS_OUT)))
        if step_dps < spread:  # coarser counts hide the shape of the noise
            histogram += np.histogram(z, EDGES)[0]
        rows, apart_dps = outliers(y_dps, step_dps)
        near = np.clip(rows[:, None] + BESIDE, 0, y_dps.size - 1)
        alone = (z[near] < POLICY.disturbed_spreads).all(axis=1)
        sizes.append((np.abs(apart_dps[alone]) - step_dps) / spread)
    found = np.concatenate(sizes) if sizes else np.zeros(0)
    if not found.size:
        return 1.0
    freedom = _freedom(histogram)
    tail = float(tails.student(POLICY.large_spreads / _unit(freedom), freedom))
    beyond = max(samples * 2 * tail, large + 2 * np.sqrt(large))  # expected beyond POLICY.large_spreads
    chances = []
    for least in STANDS_OUT * 2.0 ** np.arange(LEVELS):
        count = int(np.count_nonzero(found > least))
        if count < REPEATED:
            break
        expected = beyond * float(tails.student(least / _unit(freedom), freedom)) / tail
        chances.append(float(tails.poisson(count, expected)))
    return min(1.0, LEVELS * min(chances, default=1.0))


@cache
def _of_deviations() -> tuple[Array, Array]:
    """For each of ``FREEDOMS``: the distribution function at ``EDGES`` of deviations from the neighbours, and the scale.

    A deviation is that of the reading less that of its neighbours, the median of three means of two readings
    (:func:`~gyrocal.recording.outliers.between`). Its centre is therefore nearer to a normal distribution than its tail is. The
    scale is that of the reading's t distribution whose deviations have the median of a standard normal variable.
    """
    step = 100 / GRID
    x = step * np.arange(-GRID, GRID + 1)
    cdfs, units = [], []
    for freedom in FREEDOMS:
        one = np.exp(tails.student_log_density(x, freedom))
        mean = 2 * step * convolved(np.pad(one, 2 * GRID), one)[::2]  # at 2x = a + b the mean of two is x
        below = np.clip((np.cumsum(mean) - mean / 2) * step, 0.0, 1.0)
        median = 6 * mean * below * (1 - below)
        density = convolved(np.pad(one, GRID), median)[GRID:]
        within = (2 * np.cumsum(density) - density - density[0]) * step
        within *= (1 - 2 * tails.student(x[-1], freedom)) / within[-1]
        unit = 1 / (tails.ROBUST * float(np.interp(0.5, within, x[GRID:])))
        cdfs.append(np.interp(EDGES / unit, x[GRID:], within))
        units.append(unit)
    return np.array(cdfs).T, np.array(units)


def _unit(freedom: float) -> float:
    """Scale of the t distribution of readings whose deviations have the median of a standard normal variable."""
    return float(np.interp(np.log(freedom), np.log(FREEDOMS), _of_deviations()[1]))


def _freedom(histogram: Array) -> float:
    """The fewest degrees of freedom that the histogram of deviations below ``STANDS_OUT`` spreads allows."""
    if not histogram.any():
        return float(FREEDOMS[-1])
    cdf = _of_deviations()[0]
    inside = np.diff(cdf, axis=0) / (cdf[-1] - cdf[0])
    loglik = histogram @ np.log(np.maximum(inside, 1e-300))
    return float(FREEDOMS[int(np.argmax(loglik > loglik.max() - POLICY.tail_loss))])
