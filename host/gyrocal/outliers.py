"""Single readings that stand far out of their neighbours: bits lost on the bus, a word read half-way through an update.

One of them moves the mean of a tenth of a second by more than a real effect does, so fits never see them; they are counted,
reported, and stay in every rms.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from gyrocal.session import Array

NEIGHBOURS = 7
"""Samples whose median a reading is held against."""
STANDS_OUT = 8.0
"""Spreads by which it must differ: Gaussian noise does that once in 10^15 readings."""
MOST = 0.05
"""Of a run's readings: more than this is no outlier but how the sensor reads."""

Index = np.ndarray[Any, np.dtype[np.intp]]


def outliers(y_dps: Array, step_dps: float) -> tuple[Index, Array]:
    """Rows [k] of readings [n] that stand out, and by how much [k], deg/s; ``step_dps``: one count, 0 = as good as none."""
    from scipy.ndimage import median_filter
    from scipy.stats import norm

    nothing = np.zeros(0, dtype=np.intp), np.zeros(0)
    if y_dps.size < 3 * NEIGHBOURS:
        return nothing
    apart = y_dps - median_filter(y_dps, NEIGHBOURS, mode="nearest")
    size = np.abs(apart)
    spread = 1.4826 * float(np.median(size))
    moved = float(np.mean(size > step_dps / 2))
    if step_dps > 0 and 0 < moved < 0.5:  # coarse counts: the noise that takes so many over the edge of a count at the least
        spread = max(spread, step_dps / 2 / float(norm.isf(moved / 2)))
    rows = np.flatnonzero(size > STANDS_OUT * spread + step_dps) if spread > 0 else nothing[0]
    return (rows, apart[rows]) if 0 < rows.size <= MOST * y_dps.size else nothing
