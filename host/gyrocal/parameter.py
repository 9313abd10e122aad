"""The description of an effect or a noise component: its texts, and its parameters with units, sizes and bounds."""

from __future__ import annotations

from abc import ABC
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gyrocal.errors import InputError, did_you_mean

Values = dict[str, float]

NOT_NEGATIVE = (0.0, np.inf)
POSITIVE = (5e-324, np.inf)
ANY = (-np.inf, np.inf)


@dataclass(frozen=True)
class Parameter:
    """A parameter with its unit, the typical range of its magnitude, and the source of that range.

    ``bounds`` (inclusive) limit the values that a model file may hold. ``search`` is the range in which a fit searches a
    nonlinear parameter. By default it extends from a third of the smallest to three times the largest typical value.
    """

    name: str
    unit: str
    typical: tuple[float, float]
    source: str
    default: float | None = None
    """The value that the simulator plants by default; None = drawn anew for each run (a phase)."""
    bounds: tuple[float, float] = ANY
    search: tuple[float, float] | None = None
    sized: bool = True
    """True if a value far above ``typical`` is not physical. Phases, times and frequencies have no such limit."""

    @property
    def search_range(self) -> tuple[float, float]:
        """The range in which a nonlinear parameter is searched, (low, high)."""
        low, high = self.typical
        return self.search or (low / 3, high * 3)

    def refusal(self, value: float) -> str | None:
        """The reason why a model file may not hold ``value``, in words; None if it may."""
        low, high = self.bounds
        if low <= value <= high:
            return None
        return f"{self.name} is {value:g}, must be " + ("positive" if high == np.inf else f"from {low:g} to {high:g}")


class Described(ABC):
    """The description of an effect or a noise component, which makes a reading differ from the true rate.

    The commands, the model file and the documentation refer to it by ``id``. The other texts appear on its page.
    """

    id: ClassVar[str]
    title: ClassVar[str]
    cause: ClassVar[str]
    equation: ClassVar[str]
    looks_like: ClassVar[str]
    measure_next: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.equation}>"

    def parameter(self, name: str) -> Parameter:
        """The parameter of this name. Raises InputError, which lists the known names, if there is none."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        known = [p.name for p in self.parameters]
        raise InputError(f"effect {self.id} has no parameter {name!r}{did_you_mean(name, known)}; it has {', '.join(known)}")

    def draw(self, values: Mapping[str, float], rng: np.random.Generator) -> Values:
        """All parameters for one run: given values, else defaults, else random values (uniform phases)."""
        drawn: Values = {}
        for parameter in self.parameters:
            if parameter.name in values:
                drawn[parameter.name] = float(values[parameter.name])
            elif parameter.default is not None:
                drawn[parameter.name] = parameter.default
            else:
                drawn[parameter.name] = float(rng.uniform(*parameter.typical))
        return drawn
