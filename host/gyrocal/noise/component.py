"""The base class of noise components besides white noise. They are random, but their size can be estimated."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from gyrocal.parameter import Described, Values
from gyrocal.recording.session import Array


@dataclass(frozen=True)
class NoiseComponent(Described):
    """One component of an axis's noise. Its parameters are fields with the same names; None = not fitted yet.

    The commands and the model file refer to it by ``id``, as they do to an effect. In a model it is the field ``field_name`` of
    :class:`gyrocal.noise.axis.AxisNoise`.
    """

    field_name: ClassVar[str]
    one_draw: ClassVar[bool] = False
    """True if one draw holds for all runs of a power cycle."""
    se: Values = field(default_factory=dict, kw_only=True)
    """Standard errors of the parameters, by name."""

    @property
    def values(self) -> Values:
        """The fitted parameters, by name."""
        known = {p.name: getattr(self, p.name) for p in self.parameters}
        return {name: value for name, value in known.items() if value is not None}

    def with_values(self, values: Mapping[str, float], se: Mapping[str, float] | None = None) -> Self:
        """The same component with these parameters and standard errors, each by name."""
        return replace(self, **values, se=dict(se or {}))

    @abstractmethod
    def sample(self, n: int, dt_s: float, rng: np.random.Generator) -> Array:
        """One realisation at ``n`` samples that are ``dt_s`` seconds apart, shape [n], deg/s."""
