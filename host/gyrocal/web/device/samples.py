"""The last samples of a sensor, and the curves that are drawn from them."""

from __future__ import annotations

import threading
from dataclasses import dataclass

import numpy as np

from gyrocal.present.decimate import Array

SHOWN_S = 10.0
STRETCHES = 180
KEPT = 1 << 15


Curve = list[list[float | None]]
"""Points [time in s, value]; None where the device has no value."""


@dataclass(frozen=True)
class Frame:
    """What a chart shows: the times of the first sample ever and of the newest one in s, and curves of intervals.

    ``means`` holds seven curves in the order of the rows of :class:`Samples`; ``lows`` and ``widths`` (maximum less minimum)
    hold one for each rate.
    """

    first_s: float
    newest_s: float
    means: list[Curve]
    lows: list[Curve]
    widths: list[Curve]


class Samples:
    """The last samples of one sensor, in a ring buffer of rows [t_s, gx, gy, gz, ax, ay, az, temp]."""

    def __init__(self) -> None:
        self._rows = np.full((KEPT, 8), np.nan)
        self._count = 0
        self._first_s = 0.0
        self._lock = threading.Lock()

    def extend(self, samples: list[list[float | None]]) -> None:
        """Append rows as above. None is a value that the device does not have."""
        rows = np.array(samples, dtype=float)
        with self._lock:
            if self._count and rows[0, 0] < self._rows[(self._count - 1) % KEPT, 0]:
                self._count = 0  # the device's clock began anew
            if not self._count:
                self._first_s = rows[0, 0]
            self._rows[(self._count + np.arange(len(rows))) % KEPT] = rows
            self._count += len(rows)

    def latest(self, seconds: float) -> Array:
        """The rows of the last ``seconds``, oldest first."""
        with self._lock:
            n = min(self._count, KEPT)
            rows = self._rows[(self._count - n + np.arange(n)) % KEPT]
        return rows[np.searchsorted(rows[:, 0], rows[-1, 0] - seconds) :] if n else rows

    def frame(self, seconds: float = SHOWN_S) -> Frame:
        """The last ``seconds``, drawn from the minimum, the mean and the maximum of each of ``STRETCHES`` intervals."""
        rows = self.latest(seconds)
        if not len(rows):
            return Frame(0.0, 0.0, [[] for _ in range(7)], [], [])
        width_s = seconds / STRETCHES
        stretch = np.floor(rows[:, 0] / width_s).astype(np.int64)
        starts = np.flatnonzero(np.diff(stretch, prepend=stretch[0] - 1))
        t_s = ((stretch[starts] + 0.5) * width_s).round(4)
        values = rows[:, 1:]
        counts = np.add.reduceat(np.isfinite(values).astype(float), starts)
        sums = np.add.reduceat(np.nan_to_num(values), starts)
        mean = np.divide(sums, counts, out=np.full_like(sums, np.nan), where=counts > 0)
        low, high = (of.reduceat(values[:, :3], starts) for of in (np.fmin, np.fmax))
        return Frame(
            float(self._first_s), float(rows[-1, 0]), [_points(t_s, mean[:, i]) for i in range(7)],
            [_points(t_s, low[:, i]) for i in range(3)], [_points(t_s, high[:, i] - low[:, i]) for i in range(3)],
        )  # fmt: skip


def _points(t_s: Array, values: Array) -> Curve:
    pairs: Curve = np.column_stack([t_s, values.round(5)]).tolist()
    for i in np.flatnonzero(np.isnan(values)).tolist():
        pairs[i][1] = None
    return pairs
