"""The shapes in which a residual may depend on a variable: columns like those of an effect, but without physics."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from gyrocal.effects.base import Effect, Role, Values, elapsed_s, table_angle_rad
from gyrocal.effects.quantities import true_rate_dps
from gyrocal.recording.session import Array, Run

Index = np.ndarray[Any, np.dtype[np.intp]]


class Shape(Effect):
    """Columns that are fitted together with a model to test whether the residual depends on a variable."""

    id, title, cause, equation, looks_like, measure_next = "shape", "", "", "", "", ""
    parameters = ()


class ShapeOfEachRun(Shape):
    """A shape whose size, sign or phase differs from run to run."""

    scope = "run"
    words: str
    """A description for a sentence that begins with its amplitude."""

    @staticmethod
    @abstractmethod
    def formula(shapes: Sequence[ShapeOfEachRun]) -> list[str]:
        """Formulas for a model file that describe several shapes of this class."""


class Steps(Shape):
    """Indicator columns of the variable's steps, alone or times the true rate. Bias or scale describe the first step.

    A run without the variable belongs to no step.
    """

    def __init__(self, values: Callable[[Run], Array | None], edges: Array, times_rate: bool = False) -> None:
        self.values = values
        self.edges = edges
        self.times_rate = times_rate
        self.stands_for = Role.SCALE if times_rate else Role.BIAS  # type: ignore[misc]
        self.linear = tuple(f"step_{k}" for k in range(1, edges.size + 1))

    def lacks(self, run: Run) -> bool:
        return self.values(run) is None

    def of_samples(self, run: Run) -> Index:
        """The number of the step that each sample belongs to, shape [n], from 0."""
        found = self.values(run)
        assert found is not None
        return np.searchsorted(self.edges, found, side="right")

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        step = self.of_samples(run)
        columns = (step[:, None] == np.arange(1, self.edges.size + 1)).astype(float)
        if not self.times_rate:
            return columns
        return columns * true_rate_dps(run)[:, None] if axis == run.axis_index else np.zeros_like(columns)


class Columns(Shape):
    """``count`` functions of the variable, shape [n, count]. Each function has its own coefficient."""

    def __init__(self, of: Callable[[Run], Array | None], count: int) -> None:
        self.of = of
        self.linear = tuple(f"c{k}" for k in range(count))

    def lacks(self, run: Run) -> bool:
        return self.of(run) is None

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        found = self.of(run)
        return np.zeros((len(run), len(self.linear))) if found is None else found


class Transient(ShapeOfEachRun):
    """A start-up transient with its own size and sign in each run."""

    linear = ("size",)
    words = "dying away from the start, of another size"

    def __init__(self, tau_s: float) -> None:
        self.tau_s = tau_s

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return np.exp(-elapsed_s(run) / self.tau_s)[:, None]

    @staticmethod
    def formula(shapes: Sequence[ShapeOfEachRun]) -> list[str]:
        return [f"A*exp(-t/tau); tau={s.tau_s:g}; each run" for s in shapes if isinstance(s, Transient)]


class TableWave(ShapeOfEachRun):
    """A wave in the table's angle, ``order`` times a turn, with its own phase in each run."""

    linear = ("a", "b")

    def __init__(self, order: int) -> None:
        self.order = order
        self.words = f"{order} a turn, of another phase"

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        angle = self.order * table_angle_rad(run)
        turning = float(np.any(run.rate_dps != 0)) if not run.rate_is_mean else 0.0
        return turning * np.column_stack([np.cos(angle), np.sin(angle)])

    def groups(self, values: Mapping[str, float]) -> list[int]:
        return [0, 0]

    def named_spread(self, spread: Array, values: Mapping[str, float]) -> Values:
        return {"sd": float(spread[0])}

    @staticmethod
    def formula(shapes: Sequence[ShapeOfEachRun]) -> list[str]:
        orders = sorted(s.order for s in shapes if isinstance(s, TableWave))
        parts = [f"{name}{k}*{wave}({k}*theta)" for k in orders for name, wave in (("a", "cos"), ("b", "sin"))]
        return [f"{' + '.join(parts)}; each run"]
