"""Where another recording begins within a table: its header again, or a time that begins again."""

from __future__ import annotations

import numpy as np

from gyrocal.recording.session import Array
from gyrocal.recording.stamps import LATEST_S, Index, step_range_s

NEAR = 0.05
"""A time that goes back to within this part of what had passed, from the first one or from zero, begins again."""
FEWEST = 32
"""Samples before and after such a moment, with times that stay back. Fewer may be late arrivals, or a counter of few bits."""
SHOWN = 4
"""Recordings whose rows an error lists."""


def begins(t_s: Array, headers: Index, start_s: float = 0.0) -> tuple[int, ...]:
    """The samples at which another recording begins, by times [n], s, that count from ``start_s`` of their clock.

    ``headers`` are the samples after a line that repeats the header. A clock that was set back, and stamps that come late, stay
    near their course; a time that begins again goes back to the first one, to zero, or by more than ``LATEST_S``.
    """
    if step_range_s(t_s)[0] >= 0:
        return ()
    found, again = [0], []
    for place in (np.flatnonzero(np.diff(t_s) < 0) + 1).tolist():
        first = found[-1]
        passed_s, back_s = t_s[place - 1] - t_s[first], t_s[place - 1] - t_s[place]
        if place in headers or back_s > LATEST_S:
            found.append(place)
            continue
        near = abs(t_s[place] - t_s[first]) <= NEAR * passed_s
        zero_s, last_s = t_s[place] + start_s, t_s[place - 1] + start_s
        near = near or 0 <= zero_s <= NEAR * last_s
        after = t_s[place : place + FEWEST]
        if near and place - first >= FEWEST and after.size == FEWEST and after.max() < t_s[place - 1]:
            found.append(place)
            again.append(passed_s)
    step_s = float(np.median(np.diff(t_s)))
    if len(again) > 1 and len(again) == len(found) - 1 and np.ptp(again) <= 2 * step_s:
        return ()  # a counter that begins again at its end
    return tuple(found[1:])


def advice(rows: list[int]) -> str:
    """The options that take each recording as a run of its own, by the rows at which they begin, and their end or -1."""
    names = "abcdefghijklmnopqrstuvwxyz"
    runs = [f"--run {names[k]}:{rows[k]}:{rows[k + 1] if rows[k + 1] >= 0 else ''}" for k in range(min(SHOWN, len(rows) - 1))]
    more = ", and so on" if len(rows) - 1 > SHOWN else ""
    return f"take each recording as a run of its own ({' '.join(runs)}{more}), or number the samples with --rate-hz and no t_s"
