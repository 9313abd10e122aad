"""Where a logger whose steps scatter goes over to another rate: by the mean steps of parts, which scatter far less."""

from __future__ import annotations

import numpy as np

from gyrocal.recording.stamps import OTHER_RATE, Array, course, rate_changes
from gyrocal.recording.whole_losses import LONG

FEWEST_PARTS = 4
"""Parts of 64 steps at each rate, at least. A stall and the samples that catch up with it are shorter."""
ON_ITS_SIDE = 0.9
"""Part of the parts before and after a change whose mean step is nearer to that of their own side."""


def changes_of_rate(t_s: Array) -> tuple[tuple[float, float], ...]:
    """Where times [n], s, begin at each rate, s, and that rate, 1/s, whether their steps are even or scatter.

    Empty where all samples have one rate, and where an even course with lost samples explains the times.
    """
    found = rate_changes(t_s)
    if found or t_s.size <= 2 * FEWEST_PARTS * OTHER_RATE or course(t_s)[1]:
        return found
    steps = np.diff(t_s)
    parts = np.sort(steps[: steps.size // OTHER_RATE * OTHER_RATE].reshape(-1, OTHER_RATE), axis=1)
    means_s = parts[:, :-1].mean(axis=1)  # without the longest step, which may be a pause
    if means_s.min() <= 0:
        return ()
    edges = _changes(np.log(means_s))
    if not edges:
        return ()
    at = [0, *(_exact(steps, edge) for edge in edges)]
    sides = np.split(means_s, edges)
    return tuple((float(t_s[i]), 1 / float(np.median(side))) for i, side in zip(at, sides, strict=True))


def _changes(log_s: Array) -> list[int]:
    """The parts, whose mean steps have the logarithms ``log_s`` [k], at which another rate begins."""
    if log_s.size < 2 * FEWEST_PARTS or np.ptp(log_s) < np.log(LONG):
        return []
    total, square = (np.concatenate([[0.0], np.cumsum(values)]) for values in (log_s, log_s**2))
    k = np.arange(FEWEST_PARTS, log_s.size - FEWEST_PARTS + 1)
    within = square[-1] - total[k] ** 2 / k - (total[-1] - total[k]) ** 2 / (log_s.size - k)
    at = int(k[np.argmin(within)])
    before, after = log_s[:at], log_s[at:]
    low, high = float(np.median(before)), float(np.median(after))
    nearer_low, nearer_high = (float(np.mean(np.abs(side - low) < np.abs(side - high))) for side in (before, after))
    if abs(high - low) < np.log(LONG) or nearer_low < ON_ITS_SIDE or nearer_high > 1 - ON_ITS_SIDE:
        return []
    return [*_changes(before), at, *(at + later for later in _changes(after))]


def _exact(steps: Array, part: int) -> int:
    """The sample at which the steps [n], s, of two parts around the edge ``part`` are split best into two means."""
    first = (part - 1) * OTHER_RATE
    near = steps[first : first + 2 * OTHER_RATE]
    near = np.minimum(near, np.quantile(near, 0.95))
    total, k = np.cumsum(near)[:-1], np.arange(1, near.size)
    between = total**2 / k + (near.sum() - total) ** 2 / (near.size - k)
    return first + 1 + int(np.argmax(between))
