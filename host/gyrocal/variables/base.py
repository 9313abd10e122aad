"""What a variable is: one subclass of :class:`Variable` in a file of its own in this folder.

A comparison asks whether the residual depends on time, on temperature, on the table's angle and so on. Each of these is a
variable. Its file holds everything that is said of it: its values, the shapes that are fitted to the residual, the names that
formulas know it by, and the words and units on a screen. Comparison, ``keep``, the report and the workbench list this folder.
"""

from __future__ import annotations

import importlib
import pkgutil
from abc import ABC
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import ClassVar

import numpy as np

from gyrocal.effects.quantities import turns
from gyrocal.recording.session import Array, Run
from gyrocal.variables import terms
from gyrocal.variables.shapes import Shape, Steps

MOST_STEPS = 8
"""Steps of a variable that moves within runs."""


@dataclass(frozen=True)
class Symbol:
    """A name in formulas: what it stands for, and its value [n] in a run for an axis (0, 1, 2); None where the run lacks it."""

    meaning: str
    values: Callable[[Run, int], Array | None]


class Variable(ABC):
    """Something that a residual can depend on, in the ``runs`` of one session.

    ``self.runs`` leaves out those whose rate is known as a mean alone: their residual tells nothing within the run.
    """

    name: ClassVar[str]
    """The word that findings, JSON and sentences use: ``against`` this."""
    title: ClassVar[str]
    """The text of the button that opens its picture."""
    quantity: ClassVar[str]
    unit: ClassVar[str]
    order: ClassVar[int]
    """Its place among the others on a screen."""
    picture: ClassVar[str] = "folded"
    """``folded``: the residual drawn against :meth:`values`; ``spectrum``: the residual's spectrum."""
    components: ClassVar[tuple[str, ...]] = ()
    """Names of the columns of :meth:`values`, where there are several; each is a picture of its own."""
    of_axis: ClassVar[bool] = False
    """Whether its values differ with the axis whose residual is looked at."""
    period: ClassVar[float | None] = None
    """Values that differ by this are the same place; None where there is no such thing."""
    symbols: ClassVar[Mapping[str, Symbol]] = {}
    searched: ClassVar[tuple[str, ...]] = ()
    """The symbols among whose terms ``keep`` looks for a formula."""
    no_formula: ClassVar[str] = "it has no shape of its own"
    """Why ``keep`` finds no formula, where nothing is searched."""
    times_rate: ClassVar[bool] = True
    """Whether ``keep`` also tries the products of its terms with the true rate."""

    def __init__(self, runs: Sequence[Run]) -> None:
        self.runs = [r for r in runs if not r.rate_is_mean]

    @classmethod
    def label(cls, component: str = "") -> str:
        """Quantity and unit, for the axis of a picture."""
        return f"{cls.quantity}{f' {component}' if component else ''}, {cls.unit}"

    def values(self, run: Run, axis: int) -> Array | None:
        """Its values in a run for an axis (0, 1, 2), shape [n], with components [n, k]; None where there are none."""
        return None

    def shapes(self, axis: int) -> list[Shape]:
        """What is fitted to the residual of an axis; empty where these runs cannot show a dependence."""
        return []

    def terms(self, symbol: str, values: Array) -> list[str]:
        """Smooth terms of a formula in one of the searched symbols, whose values [n] over the session are given."""
        return terms.functions(symbol, values)

    def steps(self, axis: int, edges: Array) -> list[Shape]:
        """Steps of the variable, and of its product with the true rate where the table turns about the axis."""

        def values(run: Run) -> Array:
            found = self.values(run, axis)
            assert found is not None
            return found

        return [Steps(values, edges), *([Steps(values, edges, times_rate=True)] if turns(self.runs, axis) else [])]

    @property
    def steps_between_runs(self) -> int:
        """Steps that these runs allow for what differs between runs and hardly within them."""
        return max(2, len(self.runs) // 3)


def quantile_edges(values: Array, resolution: float, steps: int) -> Array:
    """Edges of at most ``steps`` steps that hold equally many of the values [n] each, no finer than ``resolution``."""
    if np.ptp(values) <= 2 * resolution:
        return np.zeros(0)
    edges = np.unique(np.quantile(values, np.linspace(0, 1, steps + 1)[1:-1]))
    return edges[np.concatenate([[True], np.diff(edges) > resolution])]


@cache
def variables() -> dict[str, type[Variable]]:
    """Every variable by name: one for each file of this folder, in their order on a screen."""
    package = importlib.import_module("gyrocal.variables")
    found: list[type[Variable]] = []
    for info in pkgutil.iter_modules(package.__path__):
        module = importlib.import_module(f"gyrocal.variables.{info.name}")
        classes = [c for c in vars(module).values() if isinstance(c, type) and issubclass(c, Variable)]
        found += [c for c in classes if c is not Variable and c.__module__ == module.__name__]
    return {variable.name: variable for variable in sorted(found, key=lambda v: v.order)}


def symbols() -> dict[str, Symbol]:
    """Every name of a variable in formulas."""
    return {name: symbol for variable in variables().values() for name, symbol in variable.symbols.items()}
