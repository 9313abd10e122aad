"""What a test of the residual finds."""

from __future__ import annotations

from dataclasses import dataclass, field

from gyrocal.variables.shapes import Shape


@dataclass(frozen=True)
class Finding:
    """A misfit on one axis, against one variable.

    ``chance``: that noise alone does as much; ``strength``: signal to noise, in sigma; ``shape``: what was fitted,
    where a probe found it.
    """

    axis: str
    against: str
    strength: float
    chance: float
    amplitude_dps: float
    note: str
    shape: Shape | None = field(default=None, repr=False, compare=False)
