"""The last samples of a sensor, and the curves that are drawn from them."""

from __future__ import annotations

import threading

import numpy as np

from gyrocal.web.decimate import Array, quarters, zigzag

SHOWN_S = 10.0
STRETCHES = 180
KEPT = 1 << 15


class Samples:
    """The last samples of one sensor, in a ring buffer of rows [t_s, gx, gy, gz, ax, ay, az, temp]."""

    def __init__(self) -> None:
        self._rows = np.full((KEPT, 8), np.nan)
        self._count = 0
        self._lock = threading.Lock()

    def extend(self, samples: list[list[float | None]]) -> None:
        """Append rows as above. None is a value that the device does not have."""
        rows = np.array(samples, dtype=float)
        with self._lock:
            if self._count and rows[0, 0] < self._rows[(self._count - 1) % KEPT, 0]:
                self._count = 0  # the device's clock began anew
            self._rows[(self._count + np.arange(len(rows))) % KEPT] = rows
            self._count += len(rows)

    def latest(self, seconds: float) -> Array:
        """The rows of the last ``seconds``, oldest first."""
        with self._lock:
            n = min(self._count, KEPT)
            rows = self._rows[(self._count - n + np.arange(n)) % KEPT]
        return rows[np.searchsorted(rows[:, 0], rows[-1, 0] - seconds) :] if n else rows

    def frame(self) -> tuple[float, list[list[list[float | None]]]]:
        """The newest time in s and seven curves of [t_s, value]: the minimum and the maximum of each interval."""
        rows = self.latest(SHOWN_S)
        if not len(rows):
            return 0.0, [[] for _ in range(7)]
        stretch = np.floor(rows[:, 0] * (STRETCHES / SHOWN_S)).astype(np.int64)
        starts = np.flatnonzero(np.diff(stretch, prepend=stretch[0] - 1))
        width_s = SHOWN_S / STRETCHES
        t = (stretch[starts] * width_s).round(3)
        twice = quarters(t, t + width_s).round(3)
        low, high = np.fmin.reduceat(rows[:, 1:], starts), np.fmax.reduceat(rows[:, 1:], starts)
        curves = []
        for i in range(7):
            if i == 6 or len(rows) < 2 * STRETCHES:  # slow enough for its mean
                values = (low[:, i] + high[:, i]) / 2
                curves.append(_points(t, values))
            else:
                curves.append(_points(twice, zigzag(low[:, i], high[:, i], int(stretch[0]))))
        return float(rows[-1, 0]), curves


def _points(t: Array, values: Array) -> list[list[float | None]]:
    pairs: list[list[float | None]] = np.column_stack([t, values.round(5)]).tolist()
    for i in np.flatnonzero(np.isnan(values)).tolist():
        pairs[i][1] = None
    return pairs
