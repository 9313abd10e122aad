"""The base class of variables. Each variable is one subclass of :class:`Variable` in its own file in this folder.

A comparison tests whether the residual depends on time, on temperature, on the table's angle and so on. Each of these is a
variable. Its file holds everything about it: its values, the shapes that are fitted to the residual, its names in formulas,
and the words and units on a screen. Comparison, ``keep``, the report and the workbench list this folder.
"""

from __future__ import annotations

import importlib
import pkgutil
import re
from abc import ABC
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import ClassVar

import numpy as np

from gyrocal.effects.quantities import turns
from gyrocal.recording.session import Array, Run
from gyrocal.variables import terms
from gyrocal.variables.shapes import Shape, Steps

MOST_STEPS = 8
"""Largest number of steps for a variable that changes within runs."""


@dataclass(frozen=True)
class Symbol:
    """A name in formulas, with its meaning and its values [n] in a run for an axis (0, 1, 2).

    The values are None if the run does not have them.
    """

    meaning: str
    values: Callable[[Run, int], Array | None]


class Variable(ABC):
    """Something that a residual can depend on, in the ``runs`` of one session.

    ``self.runs`` leaves out runs whose rate is known only as a mean, because they have no residual within the run.
    ``self.turns`` has these runs.
    """

    name: ClassVar[str]
    """The name that findings and JSON use under ``against``."""
    title: ClassVar[str]
    """The text of the button that opens its plot."""
    quantity: ClassVar[str]
    unit: ClassVar[str]
    order: ClassVar[int]
    """Its position among the variables on a screen."""
    picture: ClassVar[str] = "folded"
    """``folded`` plots the residual against :meth:`values`; ``spectrum`` plots the residual's spectrum."""
    components: ClassVar[tuple[str, ...]] = ()
    """Names of the columns of :meth:`values` if there are several. Each has its own plot."""
    of_axis: ClassVar[bool] = False
    """True if its values depend on the axis of the residual."""
    period: ClassVar[float | None] = None
    """Values that differ by this period are equivalent; None if the variable is not periodic."""
    marks: ClassVar[Mapping[float, str]] = {}
    """The words for its values, if it takes a few values that are no measure of anything."""
    letters: ClassVar[tuple[str, ...]] = ()
    """The symbols for it in the equations of effects, beside those of formulas; with components, one for each."""
    symbols: ClassVar[Mapping[str, Symbol]] = {}
    searched: ClassVar[tuple[str, ...]] = ()
    """The symbols in which ``keep`` searches for a formula."""
    no_formula: ClassVar[str] = "it has no shape of its own"
    """The reason why ``keep`` cannot find a formula in a variable without searched symbols."""
    times_rate: ClassVar[bool] = True
    """True if ``keep`` also tries products of its terms with the true rate."""

    def __init__(self, runs: Sequence[Run]) -> None:
        self.runs = [r for r in runs if not r.rate_is_mean]
        self.turns = [r for r in runs if r.rate_is_mean]

    @classmethod
    def label(cls, component: str = "") -> str:
        """Quantity and unit, for the axis of a plot. What has words for its values has no unit."""
        if cls.marks:
            return cls.quantity
        return f"{cls.quantity}{f' {component}' if component else ''}, {cls.unit}"

    def values(self, run: Run, axis: int) -> Array | None:
        """Its values in a run for an axis (0, 1, 2), shape [n], or [n, k] with components; None if the run has none."""
        return None

    def shapes(self, axis: int) -> list[Shape]:
        """The shapes that are fitted to the residual of an axis; empty if these runs cannot show a dependence."""
        return []

    def terms(self, symbol: str, values: Array) -> list[str]:
        """Smooth terms of a formula in one of the searched symbols, given its values [n] over the session."""
        return terms.functions(symbol, values)

    @classmethod
    def in_equation(cls, equation: str, component: str = "") -> bool:
        """True if an effect's equation contains the variable, or its component."""
        own = [f"a{component}"] if component and cls.components else [*cls.letters, *cls.symbols]
        return any(re.search(rf"(?<!\w){letter}(?!\w)", equation) for letter in own)

    def steps(self, axis: int, edges: Array, names: Sequence[str] = ()) -> list[Shape]:
        """Steps of the variable between edges [k], and steps times the true rate if the table turns about the axis.

        ``names`` [k + 1] name the steps, if the edges do not tell what they are.
        """

        def values(run: Run) -> Array | None:
            return self.values(run, axis)

        times_rate = (False, True) if turns(self.runs, axis) else (False,)
        return [Steps(values, edges, times, names, self.unit) for times in times_rate]

    @property
    def steps_between_runs(self) -> int:
        """The number of steps for a variable that differs between runs and hardly changes within them."""
        return max(2, len(self.runs) // 3)

ROUNDING = 1e-9
"""Values that differ by no more than this part of their size differ by the rounding of their means alone."""
EVEN = 0.1
"""Values are spread evenly if the rarest hold more than this fraction of the mean number."""
PLATEAU = 10.0
"""Number of values over the median number beside them, from which on they are a plateau. Ramps between plateaus are even."""


def quantile_edges(values: Array, resolution: float, steps: int) -> Array:
    """Edges of at most ``steps`` steps that hold about equally many of the values [n] each and are wider than ``resolution``.

    An edge lies at a quantile where the values are spread evenly, else where they are rarest. It never divides a plateau, on
    which only the noise of the values decides their side.
    """
    if np.ptp(values) <= max(2 * resolution, ROUNDING * float(np.abs(values).max(initial=0.0))):
        return np.zeros(0)
    bounds = np.quantile(values, (np.arange(steps) + 0.5) / steps)
    middle = np.quantile(values, np.arange(1, steps) / steps)
    edges = [
        _edge(values, low, at, high, resolution)
        for (low, high), at in zip(pairwise(bounds), middle, strict=True) if high - low > resolution
    ]  # fmt: skip
    return np.array([edge for edge, before in zip(edges, [-np.inf, *edges], strict=False) if edge - before > resolution])


def _edge(values: Array, low: float, at: float, high: float, resolution: float) -> float:
    """The quantile ``at`` if there are values everywhere between the two bounds, which are more than ``resolution`` apart, and
    if it is on no plateau.

    Otherwise the middle of the widest stretch of rarest values.
    """
    count, limits = np.histogram(values, bins=2 * int(np.ceil((high - low) / resolution)), range=(low, high))
    here = count[min(int((at - low) / (high - low) * count.size), count.size - 1)]
    if count.min() > EVEN * count.mean() and here < PLATEAU * np.median(count):
        return at
    rare = np.concatenate([[False], count == count.min(), [False]])
    begin, end = np.flatnonzero(np.diff(rare.astype(int)) > 0), np.flatnonzero(np.diff(rare.astype(int)) < 0)
    widest = int(np.argmax(end - begin))
    return float(limits[begin[widest]] + limits[end[widest]]) / 2


@cache
def variables() -> dict[str, type[Variable]]:
    """Every variable by name, one for each file of this folder, in their order on a screen."""
    package = importlib.import_module("gyrocal.variables")
    found: list[type[Variable]] = []
    for info in pkgutil.iter_modules(package.__path__):
        module = importlib.import_module(f"gyrocal.variables.{info.name}")
        classes = [c for c in vars(module).values() if isinstance(c, type) and issubclass(c, Variable)]
        found += [c for c in classes if c is not Variable and c.__module__ == module.__name__]
    return {variable.name: variable for variable in sorted(found, key=lambda v: v.order)}


def symbols() -> dict[str, Symbol]:
    """Every symbol that formulas can use, by name."""
    return {name: symbol for variable in variables().values() for name, symbol in variable.symbols.items()}
