"""An effect's size in halves of the recordings, early and late, slow and fast: a picture shows whether it is the same.

What only resembles an effect passes for it as a whole, but hardly in each part.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gyrocal.evidence.checks import turns_both_ways
from gyrocal.recording.session import Array
from gyrocal.web.values.residual_plots import panels
from gyrocal.web.values.views import Halves

LEAST_POWER = 0.1
"""Part of an effect's power that each half must hold to say anything of its size."""
LARGEST_SE = 0.5
"""Standard error, as a part of the effect's size, beyond which a half says nothing."""


def halves(axis: str, signal: Array, points: Mapping[str, Array]) -> list[Halves]:
    """The sizes of an effect in two halves, for each way to part the recordings that shows it in both.

    ``signal`` [blocks] is the fitted effect and ``points`` the residual's block means, deg/s, as
    :func:`gyrocal.web.worker.effect_picture.picture` takes them. The errors are those of the scatter between recordings.
    """
    keys = {panel.name: panel.key(axis) for panel in panels()}
    y, run = points[axis], points["run"]
    rate, of_run = points[keys["rate"]], points[keys["time"]]
    ways: list[tuple[tuple[str, str], Array]] = [
        (("first half of each run", "last half"), _above(of_run)),
        (("slow", "fast"), _above(np.abs(rate))),
        (("one direction", "the other"), _directions(rate)),
        (("cold", "warm"), _above(points[keys["temperature"]])),
    ]
    out = []
    for names, second in ways:
        use = np.isfinite(y) & np.isfinite(signal) & np.isfinite(second)
        if not use.any():
            continue
        first, last = (_size(y[use & (second == k)], signal[use & (second == k)], run[use & (second == k)]) for k in (0, 1))
        power = [float(np.sum(signal[use & (second == k)] ** 2)) for k in (0, 1)]
        if first is None or last is None or min(power) < LEAST_POWER * sum(power) or max(first[1], last[1]) > LARGEST_SE:
            continue
        out.append(Halves(names, (first[0], last[0]), (first[1], last[1])))
    return out


def _directions(rate: Array) -> Array:
    """1 where the rate is positive, 0 elsewhere, NaN where it is not known, and everywhere if it has one sign alone."""
    known = np.isfinite(rate)
    return np.where(known, rate > 0, np.nan) if turns_both_ways(rate[known]) else np.full(rate.shape, np.nan)


def _above(values: Array) -> Array:
    """1 in the half of the larger values, 0 in the other, NaN where there is no value."""
    known = values[np.isfinite(values)]
    if known.size == 0 or np.ptp(known) == 0:
        return np.full(values.shape, np.nan)
    return np.where(np.isfinite(values), values > np.median(known), np.nan)


def _size(y: Array, signal: Array, run: Array) -> tuple[float, float] | None:
    """The regression of residuals on a signal with its standard error, by the scatter of the recordings about it."""
    power = float(signal @ signal)
    runs = np.unique(run)
    if power == 0 or runs.size < 2:
        return None
    size = float(signal @ y) / power
    left = np.bincount(np.searchsorted(runs, run), signal * (y - size * signal))
    return size, float(np.sqrt(np.sum(left**2) * runs.size / (runs.size - 1))) / power
