"""Stretches of one recording in which the table turned evenly or stood still, as proposals for its runs.

A file of somebody else often holds several rates one after the other. One rate for all of it is wrong for each of them, and a
run may hold one rate alone. The stretches are found in the readings; the true rate of each is not known from them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyrocal.recording import plateaus
from gyrocal.recording.cut import Cut, Edge
from gyrocal.recording.run import Run, points_up
from gyrocal.recording.session import AXES


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
    """The plateaus of a run that holds several rates, each less its first and last window, which may hold a part of the change.

    None if its axis turns at one rate only.
    """
    found = plateaus.of_several_rates(plateaus.find(run.t_s, list(run.gyro_dps.T)))
    values = [float(p.mean_dps[run.axis_index]) for p in found]
    if not found or max(values) - min(values) < plateaus.APART_DPS:
        return []
    out = []
    for k, (plateau, value) in enumerate(zip(found, values, strict=True)):
        start_s, end_s = plateau.start_s + plateaus.WINDOW_S, plateau.stop_s - plateaus.WINDOW_S
        face = _face(run, slice(plateau.start, plateau.stop))
        out.append(Stretch(f"{k:03d}_{face}", start_s, end_s, value, face))
    return out


def _face(run: Run, rows: slice) -> str:
    """The face of a stretch by the accelerometer; that of the run where it does not tell."""
    acc_g = [run.column(name) for name in ("ax_g", "ay_g", "az_g")]
    known = [a[rows] for a in acc_g if a is not None]
    if len(known) < 3 or not np.isfinite(known).all():
        return run.face
    up = points_up(np.column_stack(known), AXES.index(run.axis))
    return run.face if up == 0 else "down" if up < 0 else "up"
