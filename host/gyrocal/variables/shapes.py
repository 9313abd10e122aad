"""The shapes in which a residual may depend on a variable: columns like those of an effect, but without physics."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from gyrocal.effects.base import Effect, Role, elapsed_s, table_angle_rad
from gyrocal.effects.coding import Coding, OneSpread
from gyrocal.effects.quantities import cosines, true_rate_dps
from gyrocal.recording.session import Array, Run

Index = np.ndarray[Any, np.dtype[np.intp]]

ALIKE = 0.3
"""Standard deviation over the runs, as a fraction of the mean, below which sizes count as the same."""
SAME_PHASE = 0.9
"""Mean of the runs' waves as a fraction of their mean size, above which they have the same phase."""

SMOOTH = 5
"""Degree of the polynomials that a smooth curve of a variable follows."""


class Shape(Effect):
    """Columns that are fitted together with a model to test whether the residual depends on a variable."""

    id, title, cause, equation, looks_like, measure_next = "shape", "", "", "", "", ""
    parameters = ()


class ShapeOfEachRun(Shape):
    """A shape whose size, sign or phase differs from run to run."""

    scope = "run"

    @abstractmethod
    def words(self, sizes: Array) -> str:
        """A description for a sentence that begins with its amplitude, from the coefficients [runs, k] of the runs."""

    @staticmethod
    @abstractmethod
    def formula(shapes: Sequence[ShapeOfEachRun]) -> list[str]:
        """Formulas for a model file that describe several shapes of this class."""


class Steps(Shape):
    """Indicator columns of the variable's steps, alone or times the true rate. Bias or scale describe the first step.

    A run without the variable belongs to no step. ``unit`` is that of the edges; ``names`` are those of the steps, if the edges
    do not tell what they are.
    """

    def __init__(
        self, values: Callable[[Run], Array | None], edges: Array, times_rate: bool = False, names: Sequence[str] = (),
        unit: str = "",
    ) -> None:  # fmt: skip
        self.values = values
        self.names = names
        self.unit = unit
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
        if run.rate_is_mean or self.lacks(run):  # no residual within the run, or no step
            return np.zeros((len(run), len(self.linear)))
        step = self.of_samples(run)
        columns = (step[:, None] == np.arange(1, self.edges.size + 1)).astype(float)
        if not self.times_rate:
            return columns
        return columns * true_rate_dps(run)[:, None] if axis == run.axis_index else np.zeros_like(columns)


    def bends(self) -> Columns:
        """Lines that bend at the edges. With the steps they are a curve that is a straight line within each step."""

        def of(run: Run) -> Array | None:
            found = self.values(run)
            if found is None:
                return None
            lines = np.column_stack([found, *(np.maximum(found - edge, 0.0) for edge in self.edges)])
            return lines * true_rate_dps(run)[:, None] if self.times_rate else lines

        return Columns(of, self.edges.size + 1)


    def smooth(self, runs: Sequence[Run]) -> Columns:
        """Polynomials of the variable over its range in these runs, up to the degree ``SMOOTH``."""
        known = [found for run in runs if (found := self.values(run)) is not None and found.size]
        low, high = min(float(x.min()) for x in known), max(float(x.max()) for x in known)
        half = max((high - low) / 2, 1e-300)

        def of(run: Run) -> Array | None:
            found = self.values(run)
            if found is None:
                return None
            curves = np.asarray(np.polynomial.legendre.legvander((found - low) / half - 1, SMOOTH)[:, 1:], dtype=np.float64)
            return curves * true_rate_dps(run)[:, None] if self.times_rate else curves

        return Columns(of, SMOOTH)


class Columns(Shape):
    """``count`` functions of the variable, shape [n, count]. Each function has its own coefficient.

    ``words`` says between what the residual differs, where the variable's name is not enough. ``label`` is the quantity and
    unit of the first function, if a picture shows the residual against it and not against the variable.
    """

    def __init__(self, of: Callable[[Run], Array | None], count: int, words: str = "", label: str = "") -> None:
        self.of = of
        self.words = words
        self.label = label
        self.linear = tuple(f"c{k}" for k in range(count))

    def lacks(self, run: Run) -> bool:
        return self.of(run) is None

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        found = self.of(run)
        return np.zeros((len(run), len(self.linear))) if found is None else found


class Course(Columns):
    """Cosines of the time in the run that are the same in all runs, up to ``count`` half periods in ``longest_s``."""

    def __init__(self, count: int, longest_s: float) -> None:
        self.longest_s = longest_s
        super().__init__(self._of, count, "in the same course in each run")

    def _of(self, run: Run) -> Array | None:
        if run.rate_is_mean:
            return None
        return cosines(elapsed_s(run) / self.longest_s, len(self.linear)).T


class Waves(Columns):
    """Waves in the known angle of the table, each order with a cosine and a sine that are the same in all runs."""

    def __init__(self, of: Callable[[Run], Array], orders: Sequence[int]) -> None:
        super().__init__(of, 2 * len(orders))
        self.orders = tuple(orders)


class StepsOfRuns(Columns):
    """Steps at moments of single runs, each with its own size. ``at`` holds a file and a time in it, s, for each."""

    def __init__(self, at: Sequence[tuple[str, float]]) -> None:
        self.at = tuple(at)
        super().__init__(self._of, len(self.at))

    def _of(self, run: Run) -> Array:
        return np.column_stack([(run.sample_s >= s) * float(run.file == file) for file, s in self.at])


def per_turn(order: float) -> str:
    """An order in words."""
    return "once per turn" if order == 1 else f"{order:.4g} per turn"


class Transient(ShapeOfEachRun):
    """A start-up transient with its own size and sign in each run."""

    linear = ("size",)

    def words(self, sizes: Array) -> str:
        alike = float(np.std(sizes)) < ALIKE * abs(float(np.mean(sizes)))
        size = "" if len(sizes) < 2 else f", of {'much the same' if alike else 'another'} size in each run"
        return f"at the start of a run, dying away with a time constant of about {self.tau_s:g} s{size}"

    def __init__(self, tau_s: float) -> None:
        self.tau_s = tau_s

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        if run.rate_is_mean:  # its only block shows an offset and no transient
            return np.zeros((len(run), 1))
        return np.exp(-elapsed_s(run) / self.tau_s)[:, None]

    @staticmethod
    def formula(shapes: Sequence[ShapeOfEachRun]) -> list[str]:
        return [f"A*exp(-t/tau); tau={s.tau_s:g}; each run" for s in shapes if isinstance(s, Transient)]


class TableWave(ShapeOfEachRun):
    """A wave in the table's angle, ``order`` times a turn, with its own phase in each run."""

    linear = ("a", "b")

    def __init__(self, order: float) -> None:
        self.order = order

    def words(self, sizes: Array) -> str:
        """The order and the phase in words, from coefficients [runs, 2]. The phases agree if their waves hardly cancel."""
        waves = sizes[:, 0] + 1j * sizes[:, 1]
        waves = waves[waves != 0]
        alike = abs(waves.sum()) > SAME_PHASE * float(np.abs(waves).sum())
        phase = "" if waves.size < 2 else f", of {'the same' if alike else 'another'} phase in each run"
        return f"{per_turn(self.order)}{phase}"

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        angle = self.order * table_angle_rad(run)
        turning = float(np.any(run.rate_dps != 0)) if not run.rate_is_mean else 0.0
        return turning * np.column_stack([np.cos(angle), np.sin(angle)])

    @property
    def coding(self) -> Coding:
        return OneSpread(self.linear)

    @staticmethod
    def formula(shapes: Sequence[ShapeOfEachRun]) -> list[str]:
        orders = sorted(round(s.order) for s in shapes if isinstance(s, TableWave))
        parts = [f"{name}{k}*{wave}({k}*theta)" for k in orders for name, wave in (("a", "cos"), ("b", "sin"))]
        return [f"{' + '.join(parts)}; each run"]
