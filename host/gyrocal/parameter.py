"""How an effect or a noise is described: its words, and its parameters with their units, sizes and bounds."""

from __future__ import annotations

from abc import ABC
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gyrocal.errors import InputError

Values = dict[str, float]

NOT_NEGATIVE = (0.0, np.inf)
POSITIVE = (5e-324, np.inf)
ANY = (-np.inf, np.inf)


@dataclass(frozen=True)
class Parameter:
    """A parameter: its unit, the typical range of its magnitude, and where that range is from.

    ``bounds`` (inclusive) are those of the values that a model file may hold. ``search`` is the range in which a fit looks for
    a nonlinear parameter; by default it is three times wider than ``typical`` at either end.
    """

    name: str
    unit: str
    typical: tuple[float, float]
    source: str
    default: float | None = None
    """What the simulator plants when no value is given; None = drawn anew for each run (a phase)."""
    bounds: tuple[float, float] = ANY
    search: tuple[float, float] | None = None
    sized: bool = True
    """Whether a value far above ``typical`` is out of the physical range. Phases, times and frequencies have no such limit."""

    @property
    def search_range(self) -> tuple[float, float]:
        """Where a nonlinear parameter is searched, (low, high)."""
        low, high = self.typical
        return self.search or (low / 3, high * 3)

    def refusal(self, value: float) -> str | None:
        """Why a model file may not hold ``value``; None if it may."""
        low, high = self.bounds
        if low <= value <= high:
            return None
        return f"{self.name} is {value:g}, must be " + ("positive" if high == np.inf else f"from {low:g} to {high:g}")


class Described(ABC):
    """Something with an id that makes a reading differ from the true rate: an effect or a noise.

    The commands, the model file and the documentation name it by ``id``; the other texts make its page.
    """

    id: ClassVar[str]
    title: ClassVar[str]
    cause: ClassVar[str]
    equation: ClassVar[str]
    looks_like: ClassVar[str]
    measure_next: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]

    def parameter(self, name: str) -> Parameter:
        """The parameter of this name; InputError naming those there are."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        known = ", ".join(p.name for p in self.parameters)
        raise InputError(f"effect {self.id} has no parameter {name!r}; it has {known}")

    def draw(self, values: Mapping[str, float], rng: np.random.Generator) -> Values:
        """All parameters for one run: those given, else the default, else drawn (a phase: uniform)."""
        drawn: Values = {}
        for parameter in self.parameters:
            if parameter.name in values:
                drawn[parameter.name] = float(values[parameter.name])
            elif parameter.default is not None:
                drawn[parameter.name] = parameter.default
            else:
                drawn[parameter.name] = float(rng.uniform(*parameter.typical))
        return drawn
