"""What has become of a parameter: its value in a model file, and this session's own estimate of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gyrocal import tails
from gyrocal.effects.base import Role
from gyrocal.error_model.model import Term


@dataclass(frozen=True)
class Moved:
    """A parameter of a model file held against a session. ``session`` is None where the session does not show it.

    ``se`` is the combined standard error of the difference: of the file, the session, and the offsets of its power cycles.
    ``z`` is the difference over it.
    """

    effect: str
    axis: str
    name: str
    unit: str
    file: float
    session: float | None = None
    se: float | None = None
    role: Role | None = field(default=None, repr=False)

    @property
    def z(self) -> float | None:
        """The difference in standard errors; None if it is not known."""
        return None if self.session is None or not self.se else (self.session - self.file) / self.se

    @property
    def chance(self) -> float:
        """The probability that noise alone makes the difference as large."""
        return 1.0 if self.z is None else float(2 * tails.normal(abs(self.z)))

    def to_json(self) -> dict[str, str | float | None]:
        return {
            "effect": self.effect, "axis": self.axis, "name": self.name, "file": self.file, "session": self.session,
            "se": self.se, "z": self.z,
        }  # fmt: skip


def parameters_moved(stated: Term, own: Term | None, more: float = 0.0) -> list[Moved]:
    """The parameters of a term of a file, held against the same term as the session has it.

    ``more`` is a variance that adds to those of both errors. Angles are compared within half a turn.
    """
    out = []
    for parameter in stated.effect.parameters:
        name = parameter.name
        if name not in stated.values:
            continue
        row = Moved(stated.effect_id, stated.axis, name, parameter.unit, stated.values[name], role=stated.effect.role)
        if own is not None and own.values.get(name) is not None and own.se.get(name):
            value = own.values[name]
            if parameter.unit == "deg" and name.startswith("phase"):
                value = row.file + (value - row.file + 180) % 360 - 180
            se = float(np.sqrt(own.se[name] ** 2 + stated.se.get(name, 0.0) ** 2 + more))
            row = Moved(row.effect, row.axis, name, row.unit, row.file, value, se, row.role)
        out.append(row)
    return out


def strongest_first(found: Sequence[Moved]) -> list[Moved]:
    """The parameters by the size of their z; those that the session does not show come last."""
    return sorted(found, key=lambda m: -abs(m.z or 0.0) if m.z is not None else 1.0)
