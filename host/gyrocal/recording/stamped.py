"""Whether stamps or numbers are the times of samples: an even sampler whose host stamps unevenly, or uneven samples.

The readings of a sensor that moves are smooth in the times at which they were taken. Each reading is predicted by its four
neighbours, by the cubic through them: over the stamps, and over the samples' numbers. The times that predict better are right.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from gyrocal.errors import InputError
from gyrocal.policy import POLICY
from gyrocal.recording.orientation import of_one_sign
from gyrocal.recording.pauses import pauses_of
from gyrocal.recording.stamps import (
    Array,
    Index,
    Stamps,
    catch_up,
    goes_back,
    in_bursts,
    regression,
    step_range_s,
    typical_step_s,
    without_repeats,
)  # fmt: skip
from gyrocal.units import number_of
from gyrocal.warning import Warning

LONGEST_S = 1e9
"""Times that span more than this, thirty years, are no times of one recording."""
UNEVEN = 0.1
"""Part of the mean step by which a step must be off it for its neighbourhood to tell stamps from numbers."""
JITTER = 0.01
"""The same beside measured orientations, which are much more precise than readings."""
GAP = 1.5
"""Steps longer than this, in intervals, may hold a lost sample."""
MOST = 200_000
"""Samples that are looked at."""
FEWEST = 64
"""Samples in uneven neighbourhoods, below which they do not tell."""
FEW = 0.01
"""Part of the stamps that may repeat or go back in a log whose others are right."""
SLOW = 10.0
"""Scatter of the stamps over that of their steps, from which on the sampler itself wanders slowly: its numbers are then better
from one sample to the next, but the stamps alone know the course."""
PARTS = 32
ERRORS = 4.0
"""Standard errors of the difference of both predictions from which on the smaller one is right."""


def without_jitter(t_s: Array, orientations: Array) -> Array:
    """Times [n], s, by regression on the numbers of the samples if these are the times of measured ``orientations`` [n, 4].

    A small jitter of the stamps does little to the readings, but the slope of an angle that turns fast shows it.
    """
    least_s, largest_s = step_range_s(t_s)
    if largest_s <= (1 + JITTER) * least_s:
        return t_s
    stamps = regression(t_s)
    right = right_times(t_s, stamps, of_one_sign(orientations), JITTER) if stamps.even else "stamps"
    return stamps.t_s if right == "numbers" else t_s


def right_times(t_s: Array, stamps: Stamps, readings: Array, uneven: float = UNEVEN) -> str | None:
    """``stamps`` or ``numbers``, whichever are the times of readings [n, k]; None where these do not tell, as at rest.

    ``t_s`` [n], s, are the stamps, which must increase, and ``stamps`` their regression. Steps that are off the mean one by
    more than the part ``uneven`` of it tell.
    """
    t_s, number, readings = t_s[:MOST], stamps.number[:MOST].astype(np.float64), readings[:MOST]
    if t_s.size < FEWEST:
        return None
    off = np.abs(np.diff(t_s) / stamps.period_s - np.diff(number)) > uneven
    near = off[:-3] | off[1:-2] | off[2:-1] | off[3:]
    inside = near & (number[4:] - number[:-4] == 4) & np.isfinite(readings[2:-2]).all(axis=1)
    if inside.sum() < FEWEST:
        return None
    by_stamp, by_number = (_errors(times, readings, inside) for times in (t_s, number))
    known = np.isfinite(by_stamp) & np.isfinite(by_number)
    by_stamp, by_number = by_stamp[known], by_number[known]
    usual = max(float(np.median(by_stamp + by_number)), 1e-300) if known.any() else 1.0
    gains = np.log((by_stamp + usual) / (by_number + usual))  # a jerk that only a few samples show does not outweigh them all
    parts = [part.mean() for part in np.array_split(gains, PARTS) if part.size]
    if len(parts) < PARTS // 2:
        return None
    sure = float(np.mean(parts)) / max(float(np.std(parts)) / len(parts) ** 0.5, 1e-300)
    local_s = float(np.std(np.diff(t_s) - stamps.period_s * np.diff(number))) / 2**0.5
    if sure > ERRORS and stamps.jitter_s > SLOW * local_s:
        return None
    return "numbers" if sure > ERRORS else "stamps" if sure < -ERRORS else None


def _errors(times: Array, readings: Array, inside: np.ndarray[Any, np.dtype[np.bool_]]) -> Array:
    """The squared error of each prediction over what noise would give it, summed over the columns of readings."""
    nodes = [times[k : times.size - 4 + k][inside] for k in (0, 1, 3, 4)]
    here = times[2:-2][inside]
    total = -readings[2:-2][inside]
    noise = np.ones(here.size)
    with np.errstate(divide="ignore", invalid="ignore"):
        for k, node in enumerate(nodes):
            weight = np.ones(here.size)
            for other in nodes[:k] + nodes[k + 1 :]:
                weight *= (here - other) / (node - other)
            total = total + weight[:, None] * readings[(0, 1, 3, 4)[k] : len(readings) - 4 + (0, 1, 3, 4)[k]][inside]
            noise += weight**2
        return np.asarray(np.sum(total**2, axis=1) / noise)


def _replaced(t_s: Array, columns: Sequence[Array]) -> str:
    """Why stamps [n], s, are to be replaced, in words; empty if they are the times of the samples."""
    least_s, largest_s = step_range_s(t_s)
    if 0 < largest_s <= (1 + UNEVEN) * least_s:
        return ""  # even; nothing of the length of the recording is made
    bursts, readings = in_bursts(t_s), np.column_stack(columns) if columns else None
    if bursts and (least_s <= 0 or readings is None):
        return "the times repeat or come in bursts, "
    if readings is None or t_s.size < FEWEST or least_s <= 0:
        return ""
    uneven = np.abs(np.diff(t_s) / typical_step_s(t_s) - 1) > UNEVEN
    if uneven.sum() < FEWEST and not bursts:
        return ""
    stamps = regression(t_s)
    if not stamps.even:
        return ""
    right = right_times(t_s, stamps, readings)
    if right == "numbers":
        return "the readings follow the numbers of the samples and not their uneven times: a host stamped them, "
    returns = stamps.jitter_s < GAP * stamps.period_s
    late = returns and catch_up(t_s) and int(np.sum(np.diff(t_s) > GAP * stamps.period_s)) > stamps.lost
    if right is None and (bursts or late):
        return "the times come in bursts, or late and caught up with later, "
    return ""


def _with_few_mended(t_s: Array, readings: Sequence[Array]) -> Array | None:
    """Stamps [n], s, of which a few repeat or go back and are put between their neighbours, if the readings follow the others.

    None where these do not, or where many stamps repeat: they are then no times of samples.
    """
    if not readings or np.mean(np.diff(t_s) <= 0) > FEW:
        return None
    mended = without_repeats(t_s)
    return mended if right_times(mended, regression(mended), np.column_stack(readings)) == "stamps" else None


def _missing_beside(number: Index, pauses: Index) -> int:
    """Samples that are missing between those of these numbers [n], and not in the pauses or where packets still settle."""
    counted = np.diff(number) - 1
    for pause in pauses.tolist():
        counted[max(0, pause - POLICY.pause_samples) : pause + POLICY.pause_samples] = 0
    return int(counted.sum())


def even(
    t_s: Array, where: Callable[[int], str], file: str,
    advice: Callable[[int], str] = lambda _: "delete what is not part of it",
    readings: Sequence[Array] = (),
) -> tuple[Array, Warning | None]:  # fmt: skip
    """Times [n], s: unchanged, or by regression with a warning if a host stamped an even sampler unevenly.

    ``where`` names a sample, and ``advice`` says what to do where the times go back at it. ``readings`` [n] of each axis tell
    whether uneven stamps are right.
    """
    what = _replaced(t_s, readings)
    if not what:
        return t_s, None
    steps_s = np.diff(t_s)
    if goes_back(t_s):
        later = int(np.argmin(steps_s)) + 1
        back = f"time goes back by {-steps_s[later - 1]:.4g} s, to another recording"
        raise InputError(f"{where(later)}: {back}; {advice(later)}")
    if t_s[-1] <= t_s[0]:
        repeated = int(np.argmax(steps_s <= 0)) + 1
        raise InputError(f"{where(repeated)}: time repeats or goes back; {advice(repeated)}")
    if t_s[-1] - t_s[0] > LONGEST_S:
        longest = int(np.argmax(steps_s)) + 1
        raise InputError(f"{where(longest)}: {steps_s[longest - 1]:.3g} s after the row before; correct the times")
    stamps = regression(t_s)
    if (kept := _with_few_mended(t_s, readings)) is not None:
        few = int(np.sum(steps_s <= 0))
        return kept, Warning(
            "sample_rate", None, file,
            f"{few} of {t_s.size} times repeat or go back, and were put between their neighbours. The readings follow all "
            "others, which stay. Record the sensor's own time if you can",
        )  # fmt: skip
    back = ""
    if stamps.set_back:
        place, by_s = stamps.set_back[0]
        more = f" and {len(stamps.set_back) - 1} times more" if len(stamps.set_back) > 1 else ""
        back = f"{where(place)}: the clock was set back by {by_s:.3g} s{more}. Moved forward by that, "
    if not stamps.even:
        return stamps.t_s, Warning(
            "sample_rate", None, file,
            f"{back}the times repeat or come in bursts, and no even course explains them; those that repeat or go back were "
            "put between their neighbours. Record the sensor's own time if you can",
        )  # fmt: skip
    what = f"{back}the times are " if back else what
    pauses = pauses_of(stamps.t_s)
    missing = _missing_beside(stamps.number, pauses)
    beside = f" beside {number_of(pauses.size, 'pause')}" if pauses.size else ""
    lost = f", {missing} samples are missing{beside}" if missing else ""
    return stamps.t_s, Warning(
        "sample_rate", None, file,
        f"{what}{round(1e3 * stamps.jitter_s, 3):.3g} ms rms off an even course of "
        f"{1 / stamps.period_s:.5g} samples a second{lost}; they were replaced by their regression on the sample's number. "
        "Record the sensor's own time if you can",
    )  # fmt: skip
