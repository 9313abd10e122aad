"""Temperature."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gyrocal.effects.quantities import temperature_c
from gyrocal.recording.session import Array, Run
from gyrocal.units import CELSIUS
from gyrocal.variables.base import MOST_STEPS, Symbol, Variable, quantile_edges
from gyrocal.variables.shapes import Shape

RESOLUTION_C = 0.05
WITHIN = 0.5
"""Part of a session's range of temperature that the runs must pass through to be cut into the steps of a ramp."""
FEW_STEPS = 2
"""Number of steps between runs up to which a ramp within the runs shows more."""


class Temperature(Variable):
    name, title, quantity, unit, order = "temperature", "Temperature", "temperature", CELSIUS, 3
    symbols: ClassVar = {"temp_c": Symbol(f"temperature, {CELSIUS}", lambda run, axis: temperature_c(run))}
    letters = ("T",)
    searched = ("temp_c",)

    def values(self, run: Run, axis: int) -> Array | None:
        return temperature_c(run)

    def shapes(self, axis: int) -> list[Shape]:
        measured_c = [temp_c for r in self.runs if (temp_c := temperature_c(r)) is not None]
        if not measured_c:
            return []
        together_c = np.concatenate(measured_c)
        moves = float(np.median([np.ptp(temp_c) for temp_c in measured_c])) > WITHIN * float(np.ptp(together_c))
        ramp = moves and self.steps_between_runs <= FEW_STEPS
        edges = quantile_edges(together_c, RESOLUTION_C, MOST_STEPS if ramp else min(MOST_STEPS, self.steps_between_runs))
        return self.steps(axis, edges) if edges.size else []
