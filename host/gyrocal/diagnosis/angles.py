"""Net angles of runs, by which a session is judged if the table's angle is known but not its rate at each moment.

The net angle of a run is the integral of its rate. A run with ``turn_deg`` has no other known quantity. In a session with such
a run, every run counts by its net angle on each axis, so that rests and turns add up in one unit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import polars as pl

from gyrocal.diagnosis.levels import excess_of
from gyrocal.inference import heldout
from gyrocal.inference.excess_error import net_angles
from gyrocal.inference.fitted import Fit
from gyrocal.inference.heldout import Fold, Prediction
from gyrocal.recording.session import AXES, Array, Session


@dataclass(frozen=True)
class Level:
    """rms of held-out angles, noise floor and excess, deg; rms and excess are None if nothing can be held out."""

    rms_deg: float | None
    floor_deg: float | None
    excess_deg: float | None = None
    excess_se_deg: float | None = None

    @staticmethod
    def of(squares: float, floor: float, error: float, noise: float, count: int) -> Level:
        """The level from mean squares of angles, their expectation with standard error, and the noise of an angle, deg^2."""
        if not count:
            return Level(None, None)
        excess, se = excess_of(squares - floor, error, noise / count)
        return Level(float(np.sqrt(squares)), float(np.sqrt(floor)), excess, se)

    def to_json(self) -> dict[str, Any]:
        return {
            "rms_deg": self.rms_deg, "floor_deg": self.floor_deg, "excess_deg": self.excess_deg,
            "excess_se_deg": self.excess_se_deg,
        }  # fmt: skip


def by_angle(session: Session) -> bool:
    """True if the session has a run of which only the net angle is known."""
    return any(run.rate_is_mean for run in session.runs)


@dataclass(frozen=True)
class Angles:
    """Net angles of all runs, held out if that is possible, and the covariance [r, r] of their noise by axis, deg^2."""

    table: pl.DataFrame = field(repr=False)
    """Columns file, t_s (the end of the run), axis, measured_deg and modelled_deg."""
    held_out: bool
    noise: dict[str, Array] = field(repr=False)

    @staticmethod
    def of(fitted: Fit, folds: Sequence[Fold]) -> Angles:
        """The net angles that a model leaves of held-out runs, in sample without ``folds``."""
        held = heldout.predictions(fitted, list(folds), net=True) if folds else heldout.fitted(fitted, net=True)
        table = pl.DataFrame([_net_angle(p) for p in held])
        return Angles(table, bool(folds), {name: net_angles(axis, folds) for name, axis in fitted.axes.items()})

    def level(self, *axes: str) -> Level:
        """The level of these axes together; all axes if none is given."""
        names = axes or tuple(self.noise)
        mine = self.table.filter(pl.col("axis").is_in(names))
        count = mine.height if self.held_out else 0
        n = max(mine.height, 1)
        power = sum(float(np.trace(self.noise[a])) for a in names) / n
        if not count:
            return Level(None, float(np.sqrt(power)))
        error = float(np.sqrt(2 * sum(float(np.sum(self.noise[a] ** 2)) for a in names))) / n
        squares = float(((mine["measured_deg"] - mine["modelled_deg"]) ** 2).sum()) / n
        return Level.of(squares, power, error, power / n, count)


def _net_angle(p: Prediction) -> dict[str, str | float]:
    weights = p.run.weights[p.rows] * p.run.duration_s / len(p.run)
    return {
        "file": p.run.file, "t_s": float(p.run.t_s[p.rows][-1]), "axis": AXES[p.axis],
        "measured_deg": float(weights @ p.measured_dps), "modelled_deg": float(weights @ p.modelled_dps),
    }  # fmt: skip
