"""Times of samples from time stamps that a host gave in bursts: by regression on the number of the sample.

A sensor samples evenly, but a logger may stamp samples when they arrive: several at once, after a wait. Their mean interval is
right and their single intervals are not. A lost sample shifts the numbers of all that follow.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]
Index = np.ndarray[Any, np.dtype[np.intp]]

BURST = 0.2
"""Smallest interval between two samples of a sampler, as a fraction of the mean interval."""
GAPS = 0.005
"""Fraction of the intervals that may be gaps of any length."""
LEAST_BURSTS = 0.001
"""Fraction of such intervals above which stamps come in bursts. Below it they are exact but for a few."""
WINDOW = 64
"""Fewest samples that a lost sample is judged by, on either side."""
PART_BURSTS = 16
"""Bursts in a part of which the slope is taken."""
ROUNDS = 3
"""Numbers and the interval are found in turn."""
LONG = 1.5
"""A step longer than this, in intervals, may hold a lost sample."""
LOST = 0.7
"""Fraction of an interval. A shift of all later stamps by more means a lost sample."""
KNOT_S = 60.0
"""The interval may change slowly: the regression is a chain of lines between moments this far apart, s."""
LATEST_S = 5.0
"""Stamps that go back by more are those of another recording, s."""
PART = 2**15
"""Samples of a part that is computed at once."""


@dataclass(frozen=True)
class Stamps:
    """Times ``t_s`` [n], s, that run forward; the mean interval ``period_s``; how far the stamps were off, rms, ``jitter_s``.

    ``number`` [n] is the number of each sample, in which lost samples are counted.
    """

    t_s: Array
    period_s: float
    number: Index
    jitter_s: float

    @property
    def lost(self) -> int:
        """Samples that are missing between the first and the last."""
        return int(self.number[-1]) + 1 - self.number.size


def step_range_s(t_s: Array) -> tuple[float, float]:
    """The shortest and the longest step of times [n], s; of fewer than two times, infinity and minus infinity.

    They are taken part by part, because memory for all steps costs more than the steps.
    """
    least, largest = np.inf, -np.inf
    for first in range(0, t_s.size - 1, PART):
        steps = np.diff(t_s[first : first + PART + 1])
        least, largest = min(least, float(steps.min())), max(largest, float(steps.max()))
    return least, largest


def in_bursts(t_s: Array) -> bool:
    """True if stamps [n], s, repeat, go back, or come in bursts that no sampler makes."""
    if _is_sampled(step_range_s(t_s)[0], _mean_with_gaps_s(t_s)):
        return False
    steps = np.diff(t_s)
    short = steps < BURST * _mean_step_s(steps)
    return bool(np.any(steps <= 0)) or (steps.size >= WINDOW and float(np.mean(short)) > LEAST_BURSTS)


def goes_back(t_s: Array) -> bool:
    """True if stamps [n], s, go back by more than a late arrival explains."""
    return bool(np.any(np.maximum.accumulate(t_s) - t_s > LATEST_S))


def weights(t_s: Array) -> Array:
    """The time from half way before each sample to half way after it, over the mean of that, shape [n]."""
    steps = np.diff(t_s)
    spans = np.concatenate([steps[:1], (steps[1:] + steps[:-1]) / 2, steps[-1:]])
    return np.asarray(spans / spans.mean())


def typical_step_s(t_s: Array) -> float:
    """The mean step of increasing times [n], s, without gaps: those of three median steps and more."""
    steps = np.diff(t_s)
    return float(np.mean(steps[steps < 3 * np.median(steps)]))


def period_s(t_s: Array) -> float:
    """The sampling interval of stamps [n], s, which may jitter, come in bursts, or have lost some samples between them."""
    return _even_interval_s(t_s) if _is_even(t_s) else _numbered(_without_stale(t_s))[1]


def regression(t_s: Array) -> Stamps:
    """The regression of stamps [n], s, on the numbers of their samples."""
    fresh_s = _without_stale(t_s)
    number, interval_s = _numbered(fresh_s)
    if t_s.size < 3:
        return Stamps(t_s, interval_s, number, 0.0)
    bends = min((t_s[-1] - t_s[0]) / KNOT_S, t_s.size - 1)
    fitted = _chain(number, fresh_s, max(2, round(bends) + 1))
    return Stamps(fitted, interval_s, number, float(np.sqrt(np.mean((t_s - fitted) ** 2))))


def _without_stale(t_s: Array) -> Array:
    """Stamps [n], s, that do not go back: those out of order tell nothing and are put on a line between their neighbours."""
    if step_range_s(t_s)[0] >= 0.0:
        return t_s
    # of two exchanged stamps the earlier goes, because the other may have come late: hence from the last to the first
    ordered = t_s.size - 1 - _longest_course(-t_s[::-1])[::-1]
    return np.interp(np.arange(t_s.size), ordered, t_s[ordered])


def _longest_course(t_s: Array) -> Index:
    """The numbers of the most samples [k] whose stamps [n], s, do not go back (Schensted, Canad. J. Math. 13 (1961) 179)."""
    ends_s: list[float] = []
    last = np.zeros(t_s.size, dtype=np.intp)
    before = np.full(t_s.size, -1, dtype=np.intp)
    for i, t in enumerate(t_s.tolist()):
        k = bisect_right(ends_s, t)
        before[i] = last[k - 1] if k else -1
        last[k] = i
        ends_s[k : k + 1] = [t]
    course = np.empty(len(ends_s), dtype=np.intp)
    i = int(last[len(ends_s) - 1])
    for k in range(len(ends_s) - 1, -1, -1):
        course[k], i = i, int(before[i])
    return course


def _numbered(t_s: Array) -> tuple[Index, float]:
    """The number of each sample [n], in which lost samples are counted, and the interval, s: the slope of times on numbers."""
    n = t_s.size
    if n < 3:
        return np.arange(n), float(t_s[-1] - t_s[0]) / max(1, n - 1)
    if _is_even(t_s):
        return np.arange(n), _even_interval_s(t_s)
    burst = _longest_burst(t_s)
    size = min(max(WINDOW, 4 * burst), n)
    interval_s = _first_interval_s(t_s, min(max(WINDOW, PART_BURSTS * burst), n), burst)
    number = np.zeros(0, dtype=np.intp)
    for _ in range(ROUNDS):
        found = (np.arange(n) + _lost(t_s, interval_s, size, 2 * burst)).astype(np.intp)
        if np.array_equal(found, number):
            break
        number, interval_s = found, _slope_s(found, t_s)
    return number, interval_s


def _mean_with_gaps_s(t_s: Array) -> float:
    return float(t_s[-1] - t_s[0]) / max(1, t_s.size - 1)


def _is_sampled(least_s: float, mean_s: float) -> bool:
    """True unless the shortest step is shorter than a sampler makes: the mean with gaps bounds that without from above."""
    return least_s > max(0.0, BURST * mean_s)


def _is_even(t_s: Array) -> bool:
    """True if stamps [n], s, three or more, are not in bursts and none is missing between them."""
    if t_s.size < 3:
        return False
    (least_s, largest_s), mean_s = step_range_s(t_s), _mean_with_gaps_s(t_s)
    return _is_sampled(least_s, mean_s) and largest_s < LONG * mean_s


def _even_interval_s(t_s: Array) -> float:
    """The least-squares slope of stamps [n], s, on the numbers 0 to n - 1, without an array of these."""
    n, start = t_s.size, float(t_s[0])
    moment = 0.0
    for first in range(0, n, PART):
        part = t_s[first : first + PART] - start
        moment += float(part @ (np.arange(first, first + part.size) - (n - 1) / 2))
    return 12 * moment / (n * (float(n) ** 2 - 1))


def _slope_s(number: Index, t_s: Array) -> float:
    """The least-squares slope of times on numbers, s."""
    centred = number - number.mean()
    return float(centred @ (t_s - t_s[0])) / float(centred @ centred)


def _mean_step_s(steps_s: Array) -> float:
    """The mean of steps [n], s, without the longest, which may be gaps."""
    kept = max(1, int(steps_s.size * (1 - GAPS)))
    return float(np.mean(np.partition(steps_s, kept - 1)[:kept]))


def _first_interval_s(t_s: Array, size: int, burst: int) -> float:
    """The interval before lost samples are known: the mean, or the median slope of parts where that is surely shorter.

    Bursts in step with the parts move all slopes alike, by the squared number of bursts in a part at most.
    """
    steps = np.diff(t_s)
    first = np.concatenate([[0], np.flatnonzero(steps > _mean_step_s(steps) / 2) + 1])  # of each burst
    number = first - first.mean()
    mean_s = float(number @ (t_s[first] - t_s[0])) / float(number @ number)
    parts = t_s[: t_s.size // size * size].reshape(-1, size)
    centred = np.arange(size) - (size - 1) / 2
    slopes = parts @ centred / float(centred @ centred)
    middle_s, scatter_s = float(np.median(slopes)), 1.25 * float(np.std(slopes)) / len(slopes) ** 0.5
    in_step_s = mean_s * (burst / size) ** 2 if burst > 1 else 0.0
    return middle_s if mean_s - middle_s > max(3 * scatter_s, in_step_s) else mean_s


def _longest_burst(t_s: Array) -> int:
    """Most samples that share one arrival."""
    steps = np.diff(t_s)
    short = steps < BURST * _mean_step_s(steps)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], short.astype(np.int8), [0]])))
    return int(np.max(edges[1::2] - edges[::2], initial=0)) + 1


def _lost(t_s: Array, interval_s: float, size: int, least: int) -> Index:
    """The number of samples lost before each sample [n].

    A late arrival is followed by others that catch up, and a loss is not. The earliest stamp but one, relative to an even
    course, of the ``size`` samples after a long step is compared with that of the samples before it. (A single stamp may
    be too early.) A step with fewer than ``least`` samples after it cannot be judged.
    """

    def earliest_s(part: Array) -> float:
        return float(np.partition(part, 1)[1]) if part.size > 2 else float(part.min())

    late_s = t_s - t_s[0] - interval_s * np.arange(t_s.size)
    lost = np.zeros(t_s.size, dtype=np.intp)
    since = 0
    for i in np.flatnonzero(np.diff(t_s)[: -least or None] > LONG * interval_s).tolist():
        i += 1
        shift_s = earliest_s(late_s[i : i + size]) - earliest_s(late_s[max(since, i - size) : i])
        count = round(shift_s / interval_s + 0.5 - LOST)
        if count > 0:
            lost[i] = count
            late_s[i:] -= count * interval_s
            since = i
    return np.cumsum(lost)


def _chain(number: Index, t_s: Array, knots: int) -> Array:
    """Least squares of times on numbers by a line with bends at ``knots`` moments, evenly spaced."""
    from scipy.linalg import solveh_banded

    x = (number - number[0]) / max(1, int(number[-1] - number[0])) * (knots - 1)
    piece = np.minimum(x.astype(np.intp), knots - 2)
    right = x - piece
    left = 1 - right
    bands = np.zeros((2, knots))
    bands[1] = np.bincount(piece, left**2, knots) + np.bincount(piece + 1, right**2, knots)
    bands[0, 1:] = np.bincount(piece, left * right, knots)[:-1]
    bands[1] += 1e-9 * bands[1].max()  # a stretch without samples
    line_s = np.polyval(np.polyfit(x, t_s - t_s[0], 1), x) + t_s[0]
    off_s = t_s - line_s
    bend_s = solveh_banded(bands, np.bincount(piece, left * off_s, knots) + np.bincount(piece + 1, right * off_s, knots))
    bent_s = line_s + left * bend_s[piece] + right * bend_s[piece + 1]
    return np.asarray(bent_s if np.all(np.diff(bent_s) > 0) else line_s)
