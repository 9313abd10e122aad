"""Bursts of samples that carry the sensor's own time: what lies between them was lost, and they are not to be evened."""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]
Index = np.ndarray[Any, np.dtype[np.intp]]

FEWEST = 64
"""Bursts, below which they do not tell."""
WHOLE = 0.9
"""Mean cosine of the phase of the bursts on the grid of their length, above which they begin at whole multiples of it."""
SEVERAL = 0.05
"""Part of the bursts that come after another number of lengths than most."""
TICKS = 4
"""Different steps within bursts, of which a clock that ticks as coarsely as the sensor samples has fewer."""


def grid_of_bursts(steps_s: Array) -> tuple[Index, float] | None:
    """The numbers [n] and the interval, s, of samples in bursts by the sensor's own clock; None where they are no such ones.

    ``steps_s`` [n - 1] are those between their stamps. A burst of as many samples as any other lasts as many intervals, and the
    next one begins whole multiples of that later, now so many and now other ones. A host that reads what waits has steps of
    its own, which have nothing to do with those of its waits.
    """
    between = np.flatnonzero(steps_s > float(np.mean(steps_s)))
    sizes = np.diff(between)
    if sizes.size < FEWEST or np.any(sizes != sizes[0]) or sizes[0] < 2:
        return None
    within_s = np.delete(steps_s[between[0] : between[-1]], between[:-1] - between[0])
    if not within_s.any() or np.unique(np.round(within_s / within_s.mean(), 3)).size <= TICKS:
        return None
    size, starts_s = int(sizes[0]), np.cumsum(steps_s)[between]
    lengths = np.diff(starts_s) / (size * float(within_s.mean()))
    if float(np.mean(np.cos(2 * np.pi * lengths))) < WHOLE or lengths.min() < 1 + WHOLE:
        return None
    whole = np.rint(lengths)
    if float(np.mean(whole != np.median(whole))) < SEVERAL:
        return None
    interval_s = float(np.median(np.diff(starts_s) / whole)) / size
    counted = np.ones(steps_s.size)
    counted[between] = np.maximum(np.rint(steps_s[between] / interval_s), 1)
    counted[between[1:]] = whole * size - (size - 1)
    return np.concatenate([[0], np.cumsum(counted)]).astype(np.intp), interval_s
