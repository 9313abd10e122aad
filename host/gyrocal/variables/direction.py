"""The direction in which the table turns, or in which its rate or the temperature changes."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gyrocal.effects.quantities import (
    rate_varies,
    sense_of_change,
    sense_of_rotation,
    temperature_by_second,
    temperature_slope_c_s,
)
from gyrocal.effects.thermal_hysteresis import ThermalHysteresis
from gyrocal.recording.session import Array, Run
from gyrocal.variables.base import Variable
from gyrocal.variables.shapes import Columns, Shape, Steps

BOTH_WAYS = np.array([0.0])
SENSES = ("the table's negative direction", "the table's positive direction, or at rest")

CHANGING = "between a rate that rises and one that falls"


class Direction(Variable):
    """+1 or -1: the sign of the temperature's change if the temperature returns within a run, else that of the table's rate."""

    name, title, quantity, unit, order = "direction", "Direction", "direction", "±1", 9
    marks: ClassVar = {-1.0: "negative", 0.0: "at rest", 1.0: "positive"}
    no_formula = "it has two values only; a formula in the rate or the temperature describes a difference between directions"

    def values(self, run: Run, axis: int) -> Array | None:
        return warming_or_cooling(run) if self._returns else sense_of_rotation(run) * run.face_sign

    def shapes(self, axis: int) -> list[Shape]:
        shapes: list[Shape] = []
        if self._returns:
            shapes.append(Columns(lambda run: warming_or_cooling(run)[:, None], 1, "between warming and cooling"))
        if {-1.0, 1.0} <= {float(np.sign(np.mean(r.rate_dps)) * r.face_sign) for r in self.runs}:
            turning = Steps(lambda run: sense_of_rotation(run) * run.face_sign, BOTH_WAYS, names=SENSES)
            shapes.append(turning)
        if rate_varies(self.runs, axis):
            shapes.append(Columns(lambda run: sense_of_change(run, axis)[:, None], 1, CHANGING))
        return shapes

    @property
    def _returns(self) -> bool:
        """True if the temperature rises and falls within a run."""
        loop = ThermalHysteresis()
        return loop.missing(self.runs, 0) is None and any(loop.missing([run], 0) is None for run in self.runs)


def warming_or_cooling(run: Run) -> Array:
    """The sign of the temperature's change, shape [n]; 0 where it rests."""
    if run.temp_c is None:
        return np.zeros(len(run))
    slope_c_s = temperature_slope_c_s(run)
    resting = 0.05 * float(np.ptp(temperature_by_second(run)[1])) / max(run.duration_s, 1.0)
    return np.where(np.abs(slope_c_s) > resting, np.sign(slope_c_s), 0.0)
