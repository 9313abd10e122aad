"""What a part of the noise is, beside white noise: random, so that no model foretells it, but of a size that can be known."""

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
    """A part of an axis's noise. Its parameters are fields of the same names; None = not fitted yet.

    The commands and the model file name it like an effect, by ``id``; in a model it is a field of
    :class:`gyrocal.noise.axis.AxisNoise`, named ``field_name``.
    """

    field_name: ClassVar[str]
    one_draw: ClassVar[bool] = False
    """Whether one draw holds for all runs of a power cycle."""
    se: Values = field(default_factory=dict, kw_only=True)
    """Standard errors of the parameters, by name."""

    @property
    def values(self) -> Values:
        """The parameters that are known, by name."""
        known = {p.name: getattr(self, p.name) for p in self.parameters}
        return {name: value for name, value in known.items() if value is not None}

    def with_values(self, values: Mapping[str, float], se: Mapping[str, float] | None = None) -> Self:
        """The same component with these parameters and standard errors, by name."""
        return replace(self, **values, se=dict(se or {}))

    @abstractmethod
    def sample(self, n: int, dt_s: float, rng: np.random.Generator) -> Array:
        """One draw of it at ``n`` samples ``dt_s`` apart, shape [n], deg/s."""
