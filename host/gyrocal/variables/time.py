"""Time in the run."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gyrocal.effects.base import elapsed_s
from gyrocal.recording.session import Array, Run
from gyrocal.variables import terms
from gyrocal.variables.base import Symbol, Variable
from gyrocal.variables.shapes import Course, Shape, Transient

FINE_S = (0.5, 1, 2, 3, 4.5, 6, 8, 11, 15)
"""Edges of the first steps, which show start-up transients, s."""
COARSE_FROM_S = 20.0
COARSE_STEPS = 6
MOST_EDGES = 16
FINEST_S = 1.7
"""Half the shortest period of a course that repeats in each run."""
LEAST_COSINES, MOST_COSINES = 6, 48
LEAST_RUNS = 3
"""Runs that a drift does not follow in the same way by chance."""
TRANSIENTS_S = (1.0, 4.0)
"""Time constants of transients whose size differs from run to run, s."""


class Time(Variable):
    name, title, quantity, unit, order = "time", "In the run", "time in the run", "s", 1
    symbols: ClassVar = {"t": Symbol("time in the run, s", lambda run, axis: elapsed_s(run))}
    searched = ("t",)

    def values(self, run: Run, axis: int) -> Array:
        return elapsed_s(run)

    def shapes(self, axis: int) -> list[Shape]:
        longest_s = max(r.duration_s for r in self.runs)
        count = int(np.clip(round(longest_s / FINEST_S), LEAST_COSINES, MOST_COSINES))
        repeated = [Course(count, longest_s)] if len(self.runs) >= LEAST_RUNS else []
        return [*self.steps(axis, edges_s(longest_s)), *repeated, *(Transient(tau_s) for tau_s in TRANSIENTS_S)]

    def terms(self, symbol: str, values: Array) -> list[str]:
        return terms.of_time(symbol, values)


def edges_s(longest_s: float) -> Array:
    """Edges of the steps in s. They are narrow at the start of a run, where transients occur."""
    coarse = np.linspace(COARSE_FROM_S, max(longest_s, COARSE_FROM_S + 1), COARSE_STEPS + 1)[:-1]
    edges = np.concatenate([FINE_S, coarse])
    return edges[edges < 0.95 * longest_s][:MOST_EDGES]
