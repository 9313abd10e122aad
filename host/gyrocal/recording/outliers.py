"""Single readings that stand far out of their neighbours: bits lost on the bus, a word read half-way through an update.

One of them moves the mean of a tenth of a second by more than a real effect does, so fits never see them; they are counted,
reported, and stay in every rms.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from gyrocal.policy import POLICY
from gyrocal.recording.session import Array
from gyrocal.tails import ROBUST

NEIGHBOURS = 7
"""Neighbours with which a reading is compared: their median, and the means of those at equal distances on both sides."""
WIDE = 63
"""Readings over whose median those are looked for of which several in a row may be off."""
STANDS_OUT = POLICY.outlier_spreads

Index = np.ndarray[Any, np.dtype[np.intp]]


def outliers(y_dps: Array, step_dps: float) -> tuple[Index, Array]:
    """Rows [k] of readings [n] that stand out, and by how much [k], deg/s; ``step_dps``: one count, 0 = as good as none.

    A log whose offset is corrected now and then has smaller steps than a count, which its usual changes show.
    """
    from scipy.ndimage import median_filter

    nothing = np.zeros(0, dtype=np.intp), np.zeros(0)
    if y_dps.size < 3 * NEIGHBOURS:
        return nothing
    level = y_dps - between(y_dps)
    least = ROBUST * float(np.median(np.abs(level)))
    if not np.any(np.abs(level) > STANDS_OUT * least + step_dps):  # no larger spread or step finds more
        return nothing
    step_dps = max(step_dps, _usual_step(y_dps))
    apart = y_dps - median_filter(y_dps, NEIGHBOURS, mode="nearest")
    spread = spread_of(level, apart, step_dps)
    nearer = np.where(np.abs(apart) < np.abs(level), apart, level)  # the one is blind to slopes, the other to steps
    rows = np.flatnonzero(np.abs(nearer) > STANDS_OUT * spread + step_dps) if spread > 0 else nothing[0]
    if rows.size > POLICY.most_outliers * y_dps.size:
        return _of_one_size(y_dps, spread) or nothing
    return (rows, _whole(y_dps, rows, nearer[rows])) if rows.size else nothing


def alone(y: Array, least: float) -> tuple[Index, Array]:
    """Rows [k] of readings [n] of a motion that stand out by more than ``least`` among still neighbours, and by how much [k].

    A motion is felt before and after its largest reading, but a damaged packet comes alone.
    """
    from scipy.ndimage import median_filter

    if y.size < WIDE:
        return np.zeros(0, dtype=np.intp), np.zeros(0)
    apart = y - median_filter(y, NEIGHBOURS, mode="nearest")
    rows = np.flatnonzero(np.abs(apart) > least)
    around = np.arange(NEIGHBOURS, WIDE // 2)
    beside = np.clip(rows[:, None] + np.concatenate([-around, around]), 0, y.size - 1)
    usual = y[beside].std(axis=1)
    single = np.abs(apart[rows]) > STANDS_OUT * usual
    return rows[single], apart[rows][single]


def _usual_step(y_dps: Array) -> float:
    """The median change of coarse readings [n], deg/s, if nearly no change is much smaller, as with counts; else 0.

    It is 0 too if no more readings change than outliers would make, two changes each.
    """
    changes = np.abs(np.diff(y_dps))
    changes = changes[changes > 0]
    if changes.size <= 2 * POLICY.most_outliers * y_dps.size:
        return 0.0
    usual = float(np.median(changes))
    return usual if np.count_nonzero(changes < usual / 2) <= POLICY.most_outliers * changes.size else 0.0


def _of_one_size(y_dps: Array, spread_dps: float) -> tuple[Index, Array] | None:
    """Many readings that are all off by the same size, as those that lack a bit, with their deviations; None if there are none.

    Nearly no reading lies between them and the others.
    """
    from scipy.ndimage import median_filter

    apart_dps = y_dps - median_filter(y_dps, WIDE, mode="mirror")
    rows = np.flatnonzero(np.abs(apart_dps) > POLICY.one_size_spreads * spread_dps)
    if not 0 < rows.size <= POLICY.most_of_one_size * y_dps.size:
        return None
    size_dps = float(np.median(np.abs(apart_dps[rows])))
    away = np.abs(apart_dps) > STANDS_OUT * spread_dps
    others = int(np.count_nonzero(away & (np.abs(np.abs(apart_dps) - size_dps) > STANDS_OUT * spread_dps)))
    return (rows, apart_dps[rows]) if others <= POLICY.most_outliers * rows.size else None


def in_readings(reading_dps: Array, rows: Index, apart_dps: Array) -> bool:
    """True if ``rows`` [k], off by ``apart_dps`` [k] from a reference, stand out among the readings [n] as well.

    An encoder that counts seldom gives rates in pulses of one size, each of which leaves a residual like an outlier.
    """
    own_dps = reading_dps[rows] - between(reading_dps)[rows]
    return float(own_dps @ own_dps) >= POLICY.read_part**2 * float(apart_dps @ apart_dps)


def _whole(y_dps: Array, rows: Index, apart_dps: Array) -> Array:
    """Deviations [k] of outliers, from the nearest readings that are none where another outlier is among the neighbours."""
    apart = np.diff(rows, prepend=-y_dps.size, append=2 * y_dps.size)
    beside = np.minimum(apart[1:], apart[:-1]) <= NEIGHBOURS // 2
    others = np.delete(np.arange(y_dps.size), rows)
    before = np.searchsorted(others, rows)
    sides = [before[:, None] - np.arange(1, 4), before[:, None] + np.arange(3)]
    levels = [np.median(y_dps[others[np.clip(side, 0, others.size - 1)]], axis=1) for side in sides]
    again_dps = y_dps[rows] - (levels[0] + levels[1]) / 2
    return np.where(beside, again_dps, apart_dps)


def spread_of(level: Array, apart: Array, step_dps: float) -> float:
    """Standard deviation of the noise about a reading's neighbours, deg/s, not affected by outliers."""
    from scipy.special import ndtri

    spread = ROBUST * float(np.median(np.abs(level)))
    moved = float(np.mean(np.abs(apart) > step_dps / 2))
    if step_dps > 0 and 0 < moved < 0.5:  # coarse counts: the noise that takes so many over the edge of a count at the least
        spread = max(spread, step_dps / 2 / -float(ndtri(moved / 2)))
    return spread


def between(y_dps: Array) -> Array:
    """The value of each reading [n] by its neighbours on both sides: the median of three pairs' means, correct on a slope."""
    wide = np.pad(y_dps, NEIGHBOURS // 2, mode="edge")
    n, middle = y_dps.size, NEIGHBOURS // 2
    one, two, three = ((wide[middle - k : middle - k + n] + wide[middle + k : middle + k + n]) / 2 for k in (1, 2, 3))
    return np.maximum(np.minimum(one, two), np.minimum(np.maximum(one, two), three))
