"""Time since power-on."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gyrocal.effects.quantities import power_on_time_s
from gyrocal.recording.session import Array, Run
from gyrocal.variables import terms
from gyrocal.variables.base import Symbol, Variable
from gyrocal.variables.shapes import Shape

LEAST_RANGE_S = 1.0
"""If all runs begin within this time after power-on, this variable is equivalent to the time in the run, s."""
MOST_EDGES = 12


class PowerOnTime(Variable):
    name, title, quantity, unit, order = "power_on_time", "Since power-on", "time since power-on", "s", 2
    letters = ("p",)
    symbols: ClassVar = {"power_on_s": Symbol("time since power-on, s", lambda run, axis: power_on_time_s(run))}
    searched = ("power_on_s",)

    def values(self, run: Run, axis: int) -> Array | None:
        return power_on_time_s(run)

    def shapes(self, axis: int) -> list[Shape]:
        known = [r for r in self.runs if r.power_on_s is not None]
        begins_s = [r.power_on_s for r in known if r.power_on_s is not None]
        if not known or np.ptp(begins_s) <= LEAST_RANGE_S:
            return []
        last_s = max(begins_s) + max(r.duration_s for r in known)
        edges = np.linspace(min(begins_s), last_s, min(MOST_EDGES, self.steps_between_runs + 1))[1:-1]
        return self.steps(axis, edges)

    def terms(self, symbol: str, values: Array) -> list[str]:
        return terms.of_time(symbol, values)
