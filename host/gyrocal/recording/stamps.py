"""Times of samples from time stamps that a host gave in bursts: by regression on the number of the sample.

A sensor samples evenly, but a logger may stamp samples when they arrive: several at once, after a wait. Their mean interval is
right and their single intervals are not. A lost sample shifts the numbers of all that follow.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np

from gyrocal.recording.bursts_of_sensor import grid_of_bursts
from gyrocal.recording.longest_course import longest_course
from gyrocal.recording.whole_losses import LONG, SCATTERED, with_whole_losses

Array = np.ndarray[Any, np.dtype[np.float64]]
Index = np.ndarray[Any, np.dtype[np.intp]]

BURST = 0.2
"""Smallest interval between two samples of a sampler, as a fraction of the mean interval."""
GAPS = 0.005
"""Fraction of the intervals that may be gaps of any length."""
MOST_GAPS = 0.1
"""Fraction of the intervals that are no repetitions, of which gaps are fewer: hundreds of samples may share one stamp."""
LEAST_BURSTS = 0.001
"""Fraction of such intervals above which stamps come in bursts. Below it they are exact but for a few."""
WINDOW = 64
"""Fewest samples that a lost sample is judged by, on either side."""
PART_BURSTS = 16
"""Bursts in a part of which the slope is taken."""
FEWEST_PARTS = 4
"""Parts whose slopes have a scatter worth the name."""
ENDS = 8
"""Part of the samples at either end that tell whether an interval makes the length of the recording."""
ROUNDS = 3
"""Numbers and the interval are found in turn."""
PAUSE = 8.0
"""Intervals. A longer step of a program's uneven loop is a pause, in which samples are missing."""
WHOLE, STATED = 0.25, 0.02
"""Fraction of an interval by which a long step may be off a whole number of them, and the usual interval off the stated one."""
LOST = 0.7
"""Fraction of an interval. A shift of all later stamps by more means a lost sample."""
KNOT_S = 60.0
"""The interval may change slowly: the regression is a chain of lines between moments this far apart, s."""
STALLED = 4.0
"""A stamp this many standard deviations late, and :data:`LONG` intervals, is of a host that stalled or had just begun."""
USUAL = 0.5
"""An interval is usual if it is off the median by less than this fraction of it."""
MOSTLY_USUAL = 0.9
"""Fraction of usual intervals from which the clock is right but for single incidents."""
FROZEN = 4
"""Fewest intervals in a row without progress that are a clock standing still, and no packet of a few samples."""
LATEST_S = 5.0
"""Stamps that go back by more are those of another recording, s."""
MOST_DAMAGED = 3
"""Damaged stamps in a row at most, with the course going on after them."""
OFTEN = 0.05
"""With more unusual steps than this part of all, the stamps scatter."""
ONCE_IN_A_WHILE = 0.02
"""Part of the samples and of the waits that a stall may make longer."""
OF_GRID = 0.02
"""Part of the steps that may be no whole number of intervals where the others are: exact stamps with lost samples."""
LONG_TICK, EXACT = 4, 2.0
"""Samples to one tick of the clock, from which on a program's wandering loop looks like losses; and the intervals within which
the first samples of ticks keep to an exact sampler's course."""
OTHER_RATE = 64
"""Steps in a row of one length, longer than the usual one: the logger has taken another rate, and lost nothing."""
CATCHES_UP = -0.25
"""Correlation of successive steps, below which a late stamp is followed by a short step: -0.5 on an even course."""
PART = 2**15
"""Samples of a part that is computed at once."""


@dataclass(frozen=True)
class Stamps:
    """Times ``t_s`` [n], s, that run forward; the mean interval ``period_s``; how far the stamps were off, rms, ``jitter_s``.

    ``number`` [n] is the number of each sample, in which lost samples are counted. ``set_back`` are the samples from which
    on the clock was set back, and by how much, s.
    """

    t_s: Array
    period_s: float
    number: Index
    jitter_s: float
    set_back: tuple[tuple[int, float], ...] = ()
    even: bool = True
    """False where no even course is: a program took the samples when it came to it, or at several rates. The stamps are then
    the times, and those that repeat or go back are put between their neighbours."""

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
    short = (steps := np.diff(t_s)) < BURST * _mean_step_s(steps)
    often = steps.size >= WINDOW and float(np.mean(short)) > LEAST_BURSTS
    return bool(np.any(steps <= 0)) or (often and grid_of_bursts(steps) is None)


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
    return course(t_s)[0]


def course(t_s: Array) -> tuple[float, bool]:
    """The sampling interval, s, and whether the course is even, as in :class:`Stamps`."""
    if _is_even(t_s):
        return _even_interval_s(t_s), True
    return _numbered(_without_stale(_without_incidents(t_s)[0]))[1:]


def lost(t_s: Array, stated_s: float) -> int:
    """Samples that are missing between stamps [n], s, of a sensor that samples every ``stated_s``.

    Where the usual step is the stated one and none is far shorter, long steps are whole numbers of it. Other stamps are late,
    or are rounded to the ticks of a host. Of stamps that come in bursts, none is known to be missing.
    """
    steps = np.diff(t_s)
    middle_s = float(np.median(steps))
    if float(steps.min()) < BURST * middle_s or middle_s < stated_s / LONG or in_bursts(t_s):
        return 0
    interval_s = float(np.mean(steps[steps < LONG * middle_s]))
    count = np.rint(steps / interval_s)
    off = np.abs(steps / interval_s - count)
    if abs(interval_s / stated_s - 1) < STATED and count.min() >= 1 and np.all(off < np.maximum(WHOLE, STATED * count)):
        return int(count.sum()) - steps.size
    return regression(t_s).lost


def regression(t_s: Array) -> Stamps:
    """The regression of stamps [n], s, on the numbers of their samples."""
    onward_s, set_back = _without_incidents(t_s)
    fresh_s = _without_stale(onward_s)
    number, interval_s, even = _numbered(fresh_s)
    if t_s.size < 3:
        return Stamps(t_s, interval_s, number, 0.0)
    if not even:
        onward_s = _onward(fresh_s, interval_s)
        return Stamps(onward_s, interval_s, number, float(np.std(t_s - onward_s)), set_back, even=False)
    fitted = _chain(number, fresh_s, _knots(fresh_s))
    late_s = t_s - fitted
    for first, by_s in set_back:
        late_s[first:] += by_s
    return Stamps(fitted, interval_s, number, float(np.std(late_s)), set_back)


def _without_incidents(t_s: Array) -> tuple[Array, tuple[tuple[int, float], ...]]:
    """Stamps [n], s, of a clock that is right but for incidents, without these; and where it was set back, by how much, s.

    A clock that stood still and then shows the right time again is put on a line meanwhile. Samples cannot come before their
    time: a clock that stays behind its course was set back, and all later stamps are moved. Other stamps stay as they are.
    """
    steps = np.diff(t_s)
    usual_s = float(np.median(steps)) if steps.size else 0.0
    usual = np.abs(steps - usual_s) < USUAL * usual_s
    if usual_s <= 0 or usual.all() or np.mean(usual) < MOSTLY_USUAL:
        return t_s, ()
    edges = np.flatnonzero(np.diff(np.concatenate([[0], ~usual, [0]]).astype(np.int8)))
    starts, ends = edges[::2], edges[1::2]
    before, after = starts - np.concatenate([[0], ends[:-1]]), np.concatenate([starts[1:], [steps.size]]) - ends
    mended, set_back = t_s.copy(), []
    for first, last, quiet in zip(starts.tolist(), ends.tolist(), np.minimum(before, after).tolist(), strict=True):
        behind_s = (last - first) * usual_s - float(t_s[last] - t_s[first])
        backward = float(steps[first:last].min()) < 0
        if backward and behind_s > LONG * usual_s and quiet >= WINDOW:
            set_back.append((last, behind_s))
            mended[last:] += behind_s
        elif last - first < FROZEN or abs(behind_s) > LONG * usual_s:
            continue
        mended[first : last + 1] = np.linspace(mended[first], mended[last], last - first + 1)
    return mended, tuple(set_back)


def _first_of_ticks(t_s: Array) -> Index:
    """The samples that a regression relies on: of a clock whose ticks serve several samples each, the first of each tick.

    That sample was taken when the tick came, and the others later. All samples of any other stamps [n], s.
    """
    steps = np.diff(t_s)
    ticks = steps[steps > 0]
    every = np.arange(t_s.size)
    if ticks.size < PART_BURSTS // 4 or ticks.size > steps.size / 2:
        return every
    whole = ticks / ticks.min()
    if np.abs(whole - np.rint(whole)).max() > 1e-3:
        return every
    return np.flatnonzero(steps > 0) + 1


def _timely(number: Index, t_s: Array) -> Index:
    """The samples that a regression of stamps [n], s, on ``number`` [n] relies on: those of a host that did not stall."""
    ticks = _first_of_ticks(t_s)
    slope_s, start_s = np.polyfit(number[ticks], t_s[ticks] - t_s[0], 1)
    late_s = t_s[ticks] - t_s[0] - start_s - slope_s * number[ticks]
    middle_s, high_s = np.quantile(late_s, [0.5, 0.84])
    return ticks[late_s - middle_s <= max(STALLED * float(high_s - middle_s), LONG * float(slope_s))]


def _without_stale(t_s: Array) -> Array:
    """Stamps [n], s, that do not go back: those out of order tell nothing and are put on a line between their neighbours."""
    if step_range_s(t_s)[0] >= 0.0:
        return t_s
    # of two exchanged stamps the earlier goes, because the other may have come late: hence from the last to the first
    ordered = t_s.size - 1 - longest_course(-t_s[::-1])[::-1]
    return np.interp(np.arange(t_s.size), ordered, t_s[ordered])


def damaged_stamps(t_s: Array) -> Index:
    """The samples [k] of stamps [n], s, that are far off while the course goes on after them: digits were lost or altered.

    They are a few in a row, between two samples that are as far apart as their number makes.
    """
    steps = np.diff(t_s)
    usual_s = float(np.median(steps)) if steps.size else 0.0
    found: list[int] = []
    for before in np.flatnonzero(steps < -WINDOW * usual_s).tolist() if usual_s > 0 else ():
        for count in range(1, MOST_DAMAGED + 1):  # those after the step back, or those before it
            first = next((
                first for first in (before + 1, before + 1 - count)
                if first > 0 and first + count < t_s.size
                and 0 < t_s[first + count] - t_s[first - 1] < LONG * (count + 1) * usual_s
            ), None)  # fmt: skip
            if first is not None:
                found += range(first, first + count)
                break
    return np.unique(np.array(found, dtype=np.intp))


def without_repeats(t_s: Array) -> Array:
    """Stamps [n], s, of which those that repeat or go back are put between their neighbours, and all others stay."""
    fresh_s = _without_stale(t_s)
    return _onward(fresh_s, _mean_step_s(np.diff(fresh_s)))


def _onward(t_s: Array, interval_s: float) -> Array:
    """Stamps [n], s, of which those that repeat are put on a line to the next one, and the last ones an interval apart."""
    first = np.concatenate([[0], np.flatnonzero(np.diff(t_s) > 0) + 1])
    every = np.arange(t_s.size)
    return np.asarray(np.interp(every, first, t_s[first]) + interval_s * np.maximum(every - first[-1], 0))


def _numbered(t_s: Array) -> tuple[Index, float, bool]:
    """The number of each sample [n], in which lost samples are counted; the interval, s: the slope of times on numbers; and
    whether the course is even. Where it is not, the numbers count the samples, and the interval is their mean one.
    """
    n = t_s.size
    if n < 3:
        return np.arange(n), _mean_with_gaps_s(t_s), True
    if _is_even(t_s):
        return np.arange(n), _even_interval_s(t_s), True
    if rate_changes(t_s):
        return np.arange(n), _mean_with_gaps_s(t_s), False
    if (on_grid := grid_of_bursts(np.diff(t_s)) or _on_grid(t_s)) is not None:
        return *on_grid, True
    if _is_on_demand(t_s):
        return *(with_whole_losses(t_s) or _with_pauses(t_s)), False
    burst = _longest_burst(t_s)
    size = min(max(WINDOW, 4 * burst), n)
    interval_s = _first_interval_s(t_s, min(max(WINDOW, PART_BURSTS * burst), n), burst)
    number = np.zeros(0, dtype=np.intp)
    for _ in range(ROUNDS):
        found = (np.arange(n) + _lost(t_s, interval_s, size, 2 * burst)).astype(np.intp)
        if np.array_equal(found, number):
            break
        timely = _timely(found, t_s)
        number, interval_s = found, _slope_s(found[timely], t_s[timely])
    if number[-1] + 1 > n and _wanders_between_ticks(t_s, number):
        every = np.arange(n)
        timely = _timely(every, t_s)
        return every, _slope_s(every[timely], t_s[timely]), True
    if _contradicts(t_s, number, interval_s, burst) or _waits_too_long(t_s, number, interval_s):
        return *_with_pauses(t_s), False
    return number, interval_s, True


def _with_pauses(t_s: Array) -> tuple[Index, float]:
    """The number of each sample [n] of stamps that keep to no course, and their mean interval, s.

    Only the samples of a long pause are counted as missing, and none that comes soon after it: it may have waited.
    """
    steps = np.diff(t_s)
    interval_s = float(np.mean(steps[steps <= PAUSE * _mean_step_s(steps)]))  # with the long ones that a short one makes up for
    missing = np.zeros(t_s.size, dtype=np.intp)
    for i in np.flatnonzero(steps > PAUSE * interval_s).tolist():
        after = min(i + round(float(steps[i]) / interval_s), t_s.size - 1)
        count = round(float(t_s[after] - t_s[i]) / interval_s) - (after - i)
        missing[i + 1] = max(0, count) if count > USUAL * float(steps[i]) / interval_s else 0
    return np.arange(t_s.size) + np.cumsum(missing), interval_s


def _wanders_between_ticks(t_s: Array, number: Index) -> bool:
    """True if the losses that ``number`` [n] holds may as well be a sampler whose interval wanders, by a clock with long ticks.

    Between two ticks a program's loop gains or falls behind by a sample or two. The first sample of each tick of an exact
    sampler comes within one interval after it, once its losses are counted, and within two where a loss is found some samples
    off. Where it does not, and would be off by less than half a tick without any loss, none is known.
    """
    ticks = _first_of_ticks(t_s)
    of_tick = t_s.size / ticks.size
    if of_tick < LONG_TICK:
        return False
    with_losses, without = (_spread(count, t_s[ticks]) for count in (number[ticks], ticks))
    return with_losses > EXACT and without < of_tick * USUAL


def _spread(number: Index, t_s: Array) -> float:
    """The range of what a line through times [n], s, on their numbers leaves, in intervals."""
    slope_s, start_s = np.polyfit(number, t_s - t_s[0], 1)
    return float(np.ptp(t_s - t_s[0] - start_s - slope_s * number)) / float(slope_s)


def _contradicts(t_s: Array, number: Index, interval_s: float, burst: int) -> bool:
    """True if stamps [n], s, cannot be those of an even sampler that lost as many samples: no course is even.

    The interval then does not make the length of the recording, or more samples are missing between two stamps than the step
    and a wait of the stamp before have room for.
    """
    late = (t_s - t_s[0]) / interval_s - number
    ends = max(1, number.size // ENDS)
    off = abs(float(np.median(late[-ends:]) - np.median(late[:ends])))
    if number[-1] + 1 == number.size:
        return bool(off > max(burst + LONG, STATED * number.size))
    if off > burst + LONG:
        return True
    early, missing = -np.diff(late), np.diff(number) > 1
    with_next = early + np.append(early[1:], 0.0)  # a sample may come on its own just before those that waited
    return bool(np.any(np.minimum(early, with_next)[missing] > burst + 0.5))


def _waits_too_long(t_s: Array, number: Index, interval_s: float) -> bool:
    """True if samples would have waited longer than from one arrival to the next, once losses are counted.

    Those of an even sampler wait no longer. Where no count of losses makes them even, they are as late as losses add up to.
    """
    steps = np.diff(t_s)
    early_s, latest_s = np.quantile(t_s - _chain(number, t_s, _knots(t_s)), [ONCE_IN_A_WHILE, 1 - ONCE_IN_A_WHILE])
    wait_s = float(np.quantile(steps[steps > _mean_step_s(steps) / 2], 1 - ONCE_IN_A_WHILE))
    return number[-1] + 1 > number.size and bool(latest_s - early_s > wait_s + LONG * interval_s)


def _knots(t_s: Array) -> int:
    """Moments at which the interval of stamps [n], s, may change."""
    return max(2, round(min((t_s[-1] - t_s[0]) / KNOT_S, t_s.size - 1)) + 1)


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


def _on_grid(t_s: Array) -> tuple[Index, float] | None:
    """The numbers and the interval of exact stamps [n], s, with lost samples; None for any other stamps.

    All steps are whole numbers of the usual one, and the samples fall ever farther behind an even course. Stamps that are
    rounded to ticks have such steps too, but keep to the course.
    """
    steps = np.diff(t_s)
    interval_s = float(np.median(steps))
    if not 0 < USUAL * _mean_step_s(steps) < interval_s or float(steps.min()) < interval_s * (1 - WHOLE):
        return None
    number = np.zeros(0, dtype=np.intp)
    for _ in range(ROUNDS):
        whole = np.rint(steps / interval_s)
        if float(np.mean(np.abs(steps / interval_s - whole) > np.maximum(WHOLE / 2, STATED * whole))) > OF_GRID:
            return None
        number = np.concatenate([[0], np.cumsum(whole)]).astype(np.intp)
        interval_s = _slope_s(number, t_s)
    every = np.arange(t_s.size)
    behind = number - np.polyval(np.polyfit(every, number, 1), every)
    return (number, interval_s) if float(np.std(behind)) >= LONG else None


def rate_changes(t_s: Array) -> tuple[tuple[float, float], ...]:
    """Where stamps [n], s, of a logger that takes another rate for a while begin at each rate, s, and that rate, 1/s.

    A rate is another one where it stays longer than losses in a row do. Empty where all samples have one rate.
    """
    least_s, largest_s = step_range_s(t_s)
    if t_s.size <= 2 * OTHER_RATE or largest_s <= LONG * least_s:
        return ()
    steps = np.diff(t_s)
    parts = np.sort(steps[: steps.size // OTHER_RATE * OTHER_RATE].reshape(-1, OTHER_RATE), axis=1)
    middle, early, late = (parts[:, OTHER_RATE * k // 4] for k in (2, 1, 3))
    even = np.flatnonzero((late - early < SCATTERED * middle) & (middle > USUAL * parts.mean(axis=1)))
    if even.size < 2 or middle[even].max() <= LONG * middle[even].min():
        return ()
    changes = [(float(t_s[0]), 1 / float(middle[even[0]]))]
    for before, part in itertools.pairwise(even.tolist()):
        usual_s, other_s = float(middle[before]), float(middle[part])
        if max(usual_s, other_s) <= LONG * min(usual_s, other_s):
            continue
        between = steps[before * OTHER_RATE : (part + 1) * OTHER_RATE]
        nearer = np.abs(between - other_s) < np.abs(between - usual_s)
        first = before * OTHER_RATE + int(np.flatnonzero(~nearer)[-1]) + 1 if not nearer.all() else before * OTHER_RATE
        changes.append((float(t_s[first]), 1 / other_s))
    return tuple(changes)


def _is_on_demand(t_s: Array) -> bool:
    """True if stamps [n], s, are of samples that a program took when it came to it: no course is even, and none is lost.

    Their steps scatter, and they do not catch up.
    """
    steps = np.diff(t_s)
    middle_s = float(np.median(steps))
    if steps.size < WINDOW or middle_s <= 0 or float(np.mean(steps < BURST * middle_s)) > LEAST_BURSTS:
        return False
    if middle_s < USUAL * _mean_step_s(steps) and not _wanders(t_s):
        return False
    off = np.clip(steps / middle_s - 1, -USUAL, USUAL)
    if float(np.mean(np.abs(off) > SCATTERED)) < OFTEN:
        return False
    return not catch_up(t_s)


def catch_up(t_s: Array) -> bool:
    """True if a long step of stamps [n], s, is followed by a short one more often than by another long one."""
    steps = np.diff(t_s)
    off = np.clip(steps / float(np.median(steps)) - 1, -USUAL, USUAL)
    off = off - off.mean()
    return float(off[1:] @ off[:-1]) <= CATCHES_UP * float(off @ off)


def _wanders(t_s: Array) -> bool:
    """True if the time that many steps of stamps [n], s, take scatters nearly as that of chance steps: no even course has that.

    False if the stamps are too few to tell.
    """
    if t_s.size < FEWEST_PARTS**2 * WINDOW:
        return False
    early_s, late_s = np.quantile(t_s[WINDOW:] - t_s[:-WINDOW], [0.16, 0.84])
    return bool((late_s - early_s) / 2 > USUAL * WINDOW**0.5 * float(np.std(_usual(np.diff(t_s)))))


def _even_interval_s(t_s: Array) -> float:
    """The least-squares slope of stamps [n], s, on the numbers 0 to n - 1, without an array of these.

    Where it does not make the length of the recording, the interval has changed, and its mean is taken.
    """
    n, start = t_s.size, float(t_s[0])
    moment = 0.0
    for first in range(0, n, PART):
        part = t_s[first : first + PART] - start
        moment += float(part @ (np.arange(first, first + part.size) - (n - 1) / 2))
    slope_s, mean_s = 12 * moment / (n * (float(n) ** 2 - 1)), _mean_with_gaps_s(t_s)
    return slope_s if abs(slope_s / mean_s - 1) * (n - 1) < LONG else mean_s


def _slope_s(number: Index, t_s: Array) -> float:
    """The least-squares slope of times on numbers, s."""
    centred = number - number.mean()
    return float(centred @ (t_s - t_s[0])) / float(centred @ centred)


def _mean_step_s(steps_s: Array) -> float:
    """The mean of steps [n], s, without the longest, which may be gaps."""
    return float(np.mean(_usual(steps_s)))


def _usual(steps_s: Array) -> Array:
    """Steps [n], s, in any order, without the longest, which may be gaps."""
    longest = min(int(np.ceil(steps_s.size * GAPS)), int(MOST_GAPS * np.sum(steps_s > 0)))
    kept = max(1, steps_s.size - longest)
    return np.partition(steps_s, kept - 1)[:kept]


def _first_interval_s(t_s: Array, size: int, burst: int) -> float:
    """The interval before lost samples are known: the mean, or the median slope of parts where that is surely shorter.

    Bursts in step with the parts move all slopes alike, by the squared number of bursts in a part at most.
    """
    steps = np.diff(t_s)
    first = np.concatenate([[0], np.flatnonzero(steps > _mean_step_s(steps) / 2) + 1])  # of each burst
    number = first - first.mean()
    mean_s = float(number @ (t_s[first] - t_s[0])) / float(number @ number)
    parts = t_s[: t_s.size // size * size].reshape(-1, size)
    if len(parts) < FEWEST_PARTS:
        return mean_s
    centred = np.arange(size) - (size - 1) / 2
    slopes = parts @ centred / float(centred @ centred)
    middle_s = float(np.median(slopes))
    scatter_s = 1.25 * 1.483 * float(np.median(np.abs(slopes - middle_s))) / len(slopes) ** 0.5  # a gap scatters one part alone
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
    be too early; of a clock that is right but for single incidents, so may that of the sample after it.) A step with fewer than
    ``least`` samples after it cannot be judged.
    """
    steps = np.diff(t_s)
    middle_s = float(np.median(steps))
    early = 2 if np.mean(np.abs(steps - middle_s) < USUAL * middle_s) > MOSTLY_USUAL else 1

    def earliest_s(part: Array) -> float:
        return float(np.partition(part, early)[early]) if part.size > early + 1 else float(part.min())

    late_s = t_s - t_s[0] - interval_s * np.arange(t_s.size)
    lost = np.zeros(t_s.size, dtype=np.intp)
    since = 0
    for i in np.flatnonzero(steps[: -least or None] > LONG * interval_s).tolist():
        stall_s = float(steps[max(0, i - WINDOW) : i + 2].max())
        waits = min(round(stall_s / interval_s), size)  # samples that may still come late
        i += 1
        before_s = earliest_s(late_s[max(since, i - size) : i])
        shift_s = earliest_s(late_s[i : i + max(size, 4 * waits)]) - before_s
        room_s = late_s[i] - before_s  # what is missing beyond that is missing after this sample
        count = round(min(shift_s, room_s) / interval_s + 0.5 - LOST)
        if count > 0:
            lost[i] = count
            late_s[i:] -= count * interval_s
            since = i
    return np.cumsum(lost)


def _chain(number: Index, t_s: Array, knots: int) -> Array:
    """Least squares of times on numbers by a line with bends at ``knots`` moments, evenly spaced."""
    from scipy.linalg import solveh_banded

    ticks = _timely(number, t_s)
    x = (number - number[0]) / max(1, int(number[-1] - number[0])) * (knots - 1)
    piece = np.minimum(x.astype(np.intp), knots - 2)
    right = x - piece
    left = 1 - right
    at, share, rest = piece[ticks], left[ticks], right[ticks]
    bands = np.zeros((2, knots))
    bands[1] = np.bincount(at, share**2, knots) + np.bincount(at + 1, rest**2, knots)
    bands[0, 1:] = np.bincount(at, share * rest, knots)[:-1]
    bands[1] += 1e-9 * bands[1].max()  # a stretch without samples
    line_s = np.polyval(np.polyfit(x[ticks], t_s[ticks] - t_s[0], 1), x) + t_s[0]
    off_s = t_s[ticks] - line_s[ticks]
    bend_s = solveh_banded(bands, np.bincount(at, share * off_s, knots) + np.bincount(at + 1, rest * off_s, knots))
    bent_s = line_s + left * bend_s[piece] + right * bend_s[piece + 1]
    return np.asarray(bent_s if np.all(np.diff(bent_s) > 0) else line_s)
