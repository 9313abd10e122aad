"""Times of day that are written as one number, hours, minutes and seconds side by side, as receivers of GPS do."""

from __future__ import annotations

import numpy as np

from gyrocal.recording.session import Array

SKIPPED = 40
"""Numbers between second 59 of a minute and second 0 of the next."""


def shows_clock(stamps: Array, unit_s: float) -> bool:
    """True if stamps [n], in a unit of ``unit_s``, are the digits of a clock (``123825.3`` is 12:38:25.3) and count no seconds.

    The digits of the seconds stay below 60, and each new minute skips the 40 numbers from 60 to 99.
    """
    second = np.floor(stamps * unit_s + 1e-6)
    minute, hour = second // 100, second // 10_000
    inside = (second % 100 < 60) & (minute % 100 < 60) & (hour >= 0) & (hour < 24)
    steps = np.diff(second)
    skips = (np.diff(minute) >= 1) & (steps >= SKIPPED) & (steps < SKIPPED + 60)
    return bool(inside.all() and skips.any() and skips.sum() == np.sum(np.abs(steps) >= SKIPPED))
