"""The rig: which poses, rates, temperatures and times a person can choose from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gyrocal.errors import InputError
from gyrocal.recording.header import Axis, Face
from gyrocal.recording.plan_file import PlannedRun
from gyrocal.recording.session import Run, Session

FACES: tuple[Face, Face] = ("up", "down")
FRACTIONS = (0.0, 1.0, -1.0, 0.5, -0.5)
"""Rates of the table, as fractions of the largest; of equally good ones, a plan has the first."""
START_S, GAP_S = 5.0, 10.0
"""From power-on to the first sample, and from one run to the next in a power cycle, where the session does not say."""


@dataclass(frozen=True)
class Pose:
    """One setting of the rig: ``temp_c`` is the air of the chamber, degC; None = the room."""

    axis: Axis
    face: Face
    table_rate_dps: float
    temp_c: float | None

    def planned(self, seconds: float, scenario: str) -> PlannedRun:
        """A run of this pose in the plan's file, ``seconds`` long."""
        return PlannedRun(self.axis, self.face, self.table_rate_dps, seconds, self.temp_c, scenario)


Cycle = tuple[Pose, ...]
"""The poses of one power cycle, each one run."""


@dataclass(frozen=True)
class Rig:
    """What a person can set. ``start_s`` is the time from power-on to the first sample, ``gap_s`` that between two runs, s."""

    axes: tuple[Axis, ...]
    rates_dps: tuple[float, ...]
    temps_c: tuple[float | None, ...]
    seconds: float
    start_s: float
    gap_s: float

    @staticmethod
    def of(session: Session, table_dps: float | None = None, chamber_c: tuple[float, float] | None = None) -> Rig:
        """The rig of a session, with the largest rate of the table (deg/s) and a chamber's range (degC) where these are given.

        Raises InputError for a session whose runs are not at constant rates of a table.
        """
        rates = [run.table_rate_dps for run in session.runs if run.table_rate_dps is not None and run.reference_dps is None]
        if len(rates) < len(session.runs):
            raise InputError(
                "plan needs runs at constant rates of a table (table_rate_dps); motion with a measured reference is not planned"
            )
        largest = max(map(abs, rates)) if table_dps is None else table_dps
        if not 0.0 <= largest < np.inf:
            raise InputError(f"--table {largest:g}: want the table's largest rate, dps")
        temps: tuple[float | None, ...] = (None,)
        if chamber_c is not None:
            low, high = chamber_c
            if not -100.0 <= low < high <= 200.0:
                raise InputError(f"--chamber {low:g}:{high:g}: want MIN_C:MAX_C, the lower temperature first, °C")
            temps = (None, low, high)
        starts, gaps = _pauses(session.runs)
        return Rig(
            tuple(dict.fromkeys(run.axis for run in session.runs)),
            tuple(dict.fromkeys(round(f * largest, 6) + 0.0 for f in FRACTIONS)),
            temps,
            float(np.median([run.duration_s for run in session.runs])),
            float(np.median(starts)) if starts else START_S,
            float(np.median(gaps)) if gaps else GAP_S,
        )

    @property
    def poses(self) -> list[Pose]:
        """All combinations of axis, temperature, face and rate."""
        return [Pose(a, f, r, t) for a in self.axes for t in self.temps_c for f in FACES for r in self.rates_dps]

    def cycles(self) -> Iterator[Cycle]:
        """The power cycles of one run, and those of two of which the second differs in one setting or turns the part over."""
        for first in self.poses:
            yield (first,)
            for second in self.poses:
                changes = (
                    first.face != second.face, first.table_rate_dps != second.table_rate_dps, first.temp_c != second.temp_c
                )  # fmt: skip
                if first.axis == second.axis and sum(changes) == 1:
                    yield (first, second)


def _pauses(runs: Sequence[Run]) -> tuple[list[float], list[float]]:
    """From power-on to the first run of each power cycle, and from each further run's predecessor to it, s."""
    starts, gaps = [], []
    ends: dict[str, float] = {}
    for run in runs:
        if run.power_on_s is None:
            continue
        if run.scenario in ends:
            gaps.append(max(0.0, run.power_on_s - ends[run.scenario]))
        else:
            starts.append(run.power_on_s)
        ends[run.scenario] = run.power_on_s + run.duration_s
    return starts, gaps
