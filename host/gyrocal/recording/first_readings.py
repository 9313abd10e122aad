"""First readings of a run that are off what follows, and last ones that are off what precedes."""

from __future__ import annotations

import numpy as np

from gyrocal.recording.session import Array

FIRST, FOLLOWING = 3, 30
"""Number of readings at the beginning of a run that are compared with a line, and of those that determine the line."""
STANDS_OFF, STANDS_OFF_STEPS = 10.0, 3.0


def first_apart(y_dps: Array, step_dps: float, least_dps: float = 0.0) -> Array:
    """How far each of the first readings is off the line through those that follow, shape [FIRST], deg/s.

    All are 0 unless the very first one stands off by ``STANDS_OFF`` times the noise and ``least_dps``: a register that was not
    yet filled, or a filter that has not settled.
    """
    nothing = np.zeros(min(FIRST, y_dps.size))
    if y_dps.size < FIRST + FOLLOWING:
        return nothing
    index = np.arange(FIRST + FOLLOWING) - (FIRST + (FOLLOWING - 1) / 2)
    line = y_dps[FIRST : index.size]
    slope = float(index[FIRST:] @ line / (index[FIRST:] @ index[FIRST:]))
    left = y_dps[: index.size] - (line.mean() + slope * index)
    noise = float(np.sqrt(np.mean(left[FIRST:] ** 2)))
    least = STANDS_OFF * noise + STANDS_OFF_STEPS * step_dps + least_dps
    return np.where(np.abs(left[:FIRST]) > least, left[:FIRST], 0.0) if noise > 0 and abs(left[0]) > least else nothing


def last_apart(y_dps: Array, step_dps: float, least_dps: float = 0.0) -> Array:
    """How far each of the last readings is off the line through those that precede, as :func:`first_apart`, shape [FIRST]."""
    return first_apart(y_dps[::-1], step_dps, least_dps)[::-1]


def without_ends(y_dps: Array, step_dps: float) -> Array:
    """Readings [n], deg/s, with the first and last ones that stand off put onto the line through those beside them."""
    first, last = first_apart(y_dps, step_dps), last_apart(y_dps, step_dps)
    if not first.any() and not last.any():
        return y_dps
    out = y_dps.copy()
    out[: first.size] -= first
    out[out.size - last.size :] -= last
    return out
