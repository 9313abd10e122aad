"""Stretches of one recording in which the table turned evenly or stood still, as proposals for its runs.

A file of somebody else often holds several rates one after the other. One rate for all of it is wrong for each of them, and a
run may hold one rate alone. The stretches are found in the readings; the true rate of each is not known from them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gyrocal.recording.cut import Cut, Edge
from gyrocal.recording.run import Run, points_up
from gyrocal.recording.session import AXES, Array

BLOCK_S = 0.25
LEAST_S = 2.0
"""A stretch lasts as long at least."""
APART_DPS = 5.0
"""Stretches whose means all lie closer together are one rate."""
LEAST_CHANGE_DPS = 0.3
PART_OF_RATE = 0.01
"""A mean of a block that is further off its stretch, by this and this part of the rate, ends it; a table's ripple is less."""
NOISE_ERRORS = 8.0
"""Standard deviations of a block's mean by which it must be off, where that is more."""


@dataclass(frozen=True)
class Stretch:
    """A stretch from ``start_s`` to ``end_s`` after the first sample, and the mean reading of the axis in it."""

    name: str
    start_s: float
    end_s: float
    mean_dps: float
    face: str

    def cut(self, face: str, table_rate_dps: float | None) -> Cut:
        """The run that it becomes."""
        rate = {} if table_rate_dps is None else {"table_rate_dps": table_rate_dps}
        return Cut(self.name, Edge(self.start_s, True), Edge(self.end_s, True), {"face": face, **rate})


def stretches(run: Run) -> list[Stretch]:
    """The stretches of a run in which the rates about all axes stay the same; none if it holds one rate only."""
    t_s = run.t_s - run.t_s[0]
    block = (t_s / BLOCK_S).astype(np.int64)
    number = int(block[-1]) + 1
    count = np.bincount(block, minlength=number)
    known = np.flatnonzero(count)
    means = np.stack([np.bincount(block, run.gyro_dps[:, k], number)[known] / count[known] for k in range(3)], axis=1)
    found = [(first, last) for first, last in _alike(known, means) if (known[last] - known[first] - 1) * BLOCK_S >= LEAST_S]
    values = [float(means[first + 1 : last, run.axis_index].mean()) for first, last in found]
    if len(found) < 2 or max(values) - min(values) < APART_DPS:
        return []
    out = []
    for k, ((first, last), value) in enumerate(zip(found, values, strict=True)):  # its end blocks hold a part of the change
        start_s, end_s = float(known[first] + 1) * BLOCK_S, float(known[last]) * BLOCK_S
        face = _face(run, (t_s >= start_s) & (t_s < end_s))
        out.append(Stretch(f"{k:03d}_{face}", start_s, end_s, value, face))
    return out


def _alike(known: Any, means: Array) -> list[tuple[int, int]]:
    """First and last place of successive blocks [k, 3] that stay near the mean of those before them."""
    steps = np.abs(np.diff(means, axis=0))
    noise = NOISE_ERRORS * 1.48 * np.median(steps, axis=0) / np.sqrt(2) if len(steps) else np.zeros(3)
    out: list[tuple[int, int]] = []
    first, total = 0, means[0].copy()
    for k in range(1, len(means)):
        mean = total / (k - first)
        limit = np.maximum(noise, LEAST_CHANGE_DPS + PART_OF_RATE * float(np.max(np.abs(mean))))
        if known[k] - known[k - 1] > 1 or np.any(np.abs(means[k] - mean) > limit):
            out.append((first, k - 1))
            first, total = k, np.zeros(3)
        total += means[k]
    return [*out, (first, len(means) - 1)]


def _face(run: Run, rows: Any) -> str:
    """The face of a stretch by the accelerometer; that of the run where it does not tell."""
    acc_g = [run.column(name) for name in ("ax_g", "ay_g", "az_g")]
    known = [a[rows] for a in acc_g if a is not None]
    if len(known) < 3 or not np.isfinite(known).all():
        return run.face
    up = points_up(np.column_stack(known), AXES.index(run.axis))
    return run.face if up == 0 else "down" if up < 0 else "up"
