"""Single readings that stand far out of their neighbours: bits lost on the bus, a word read half-way through an update.

One of them moves the mean of a tenth of a second by more than a real effect does, so fits never see them; they are counted,
reported, and stay in every rms.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

NEIGHBOURS = 7
"""Samples that a reading is held against: their median, and the means of those at the same distance on either side."""
STANDS_OUT = POLICY.outlier_spreads
ROBUST = 1.4826
"""Standard deviation over median absolute deviation of a normal distribution."""
EDGES = np.linspace(0.0, STANDS_OUT, 161)
FREEDOMS = np.array([1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 8.0, 10.0, 14.0, 20.0, 40.0, 100.0, 1e6])
ALLOWED = 2.0
"""Log-likelihood by which degrees of freedom may be worse than the best and still be those of the noise."""
LARGE = 4.0
"""Spreads from which on deviations show the tail of the noise. If there are more than the t distribution has, they count."""
LEVELS = 5
"""Sizes at which outliers are counted, each twice the one before."""
DISTURBED = 3.0
"""Spreads from which on a neighbour is disturbed too."""
BESIDE = np.array([-3, -2, -1, 1, 2, 3])

Index = np.ndarray[Any, np.dtype[np.intp]]


def outliers(y_dps: Array, step_dps: float) -> tuple[Index, Array]:
    """Rows [k] of readings [n] that stand out, and by how much [k], deg/s; ``step_dps``: one count, 0 = as good as none."""
    from scipy.ndimage import median_filter

    nothing = np.zeros(0, dtype=np.intp), np.zeros(0)
    if y_dps.size < 3 * NEIGHBOURS:
        return nothing
    apart = y_dps - median_filter(y_dps, NEIGHBOURS, mode="nearest")
    level = y_dps - _between(y_dps)
    spread = _spread(level, apart, step_dps)
    nearer = np.where(np.abs(apart) < np.abs(level), apart, level)  # the one is blind to slopes, the other to steps
    rows = np.flatnonzero(np.abs(nearer) > STANDS_OUT * spread + step_dps) if spread > 0 else nothing[0]
    return (rows, nearer[rows]) if 0 < rows.size <= POLICY.most_outliers * y_dps.size else nothing


def _spread(level: Array, apart: Array, step_dps: float) -> float:
    """Standard deviation of the noise about a reading's neighbours, deg/s, whatever the outliers."""
    from scipy.stats import norm

    spread = ROBUST * float(np.median(np.abs(level)))
    moved = float(np.mean(np.abs(apart) > step_dps / 2))
    if step_dps > 0 and 0 < moved < 0.5:  # coarse counts: the noise that takes so many over the edge of a count at the least
        spread = max(spread, step_dps / 2 / float(norm.isf(moved / 2)))
    return spread


def chance_of(residuals: Sequence[Array], step_dps: float) -> float:
    """Probability that the noise of these residuals [n] itself, with the tail that it has, produces their outliers.

    Noise is Student's t, and what it has beyond ``STANDS_OUT`` spreads is expected from what it has below: the likelihood of a
    t distribution truncated there gives the degrees of freedom, of which the fewest that the data allow count. An outlier
    beside other large deviations belongs to a burst of interference and does not count.
    """
    from scipy.ndimage import median_filter
    from scipy.stats import poisson, t

    histogram, samples, large, sizes = np.zeros(EDGES.size - 1), 0, 0, []
    for y_dps in residuals:
        if y_dps.size < 3 * NEIGHBOURS:
            continue
        level = y_dps - _between(y_dps)
        spread = _spread(level, y_dps - median_filter(y_dps, NEIGHBOURS, mode="nearest"), step_dps)
        if spread <= 0:
            continue
        samples += y_dps.size
        z = np.abs(level) / spread
        large += int(np.count_nonzero((z > LARGE) & (z < STANDS_OUT)))
        if step_dps < spread:  # coarser counts hide the shape of the noise
            histogram += np.histogram(z, EDGES)[0]
        rows, apart_dps = outliers(y_dps, step_dps)
        near = np.clip(rows[:, None] + BESIDE, 0, y_dps.size - 1)
        alone = (z[near] < DISTURBED).all(axis=1)
        sizes.append((np.abs(apart_dps[alone]) - step_dps) / spread)
    found = np.concatenate(sizes) if sizes else np.zeros(0)
    if not found.size:
        return 1.0
    freedom = _freedom(histogram)
    tail = float(t.sf(LARGE / _unit(freedom), freedom))
    beyond = max(samples * 2 * tail, large + 2 * np.sqrt(large))  # expected beyond LARGE
    chances = []
    for least in STANDS_OUT * 2.0 ** np.arange(LEVELS):
        expected = beyond * float(t.sf(least / _unit(freedom), freedom)) / tail
        chances.append(float(poisson.sf(int(np.count_nonzero(found > least)) - 1, expected)))
    return min(1.0, LEVELS * min(chances))


def _unit(freedom: Array | float) -> Array | float:
    """Scale of t distributions whose median absolute deviation is that of a standard normal one."""
    from scipy.stats import t

    return 1 / (ROBUST * t.ppf(0.75, freedom))


def _freedom(histogram: Array) -> float:
    """The fewest degrees of freedom that the histogram of deviations below ``STANDS_OUT`` spreads allows."""
    from scipy.stats import t

    if not histogram.any():
        return float(FREEDOMS[-1])
    cdf = t.cdf(EDGES[:, None] / _unit(FREEDOMS), FREEDOMS)
    inside = np.diff(cdf, axis=0) / (cdf[-1] - cdf[0])
    loglik = histogram @ np.log(np.maximum(inside, 1e-300))
    return float(FREEDOMS[int(np.argmax(loglik > loglik.max() - ALLOWED))])


def _between(y_dps: Array) -> Array:
    """Where each reading [n] should be by its neighbours on both sides: the median of three pairs' means, true on a slope."""
    wide = np.pad(y_dps, NEIGHBOURS // 2, mode="edge")
    n, middle = y_dps.size, NEIGHBOURS // 2
    one, two, three = ((wide[middle - k : middle - k + n] + wide[middle + k : middle + k + n]) / 2 for k in (1, 2, 3))
    return np.maximum(np.minimum(one, two), np.minimum(np.maximum(one, two), three))
