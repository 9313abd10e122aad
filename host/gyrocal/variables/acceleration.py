"""Acceleration along the sensor's three axes."""

from __future__ import annotations

from typing import ClassVar

from gyrocal.effects.quantities import acceleration_g, pose_changes
from gyrocal.recording.session import AXES, Array, Run
from gyrocal.variables.base import Symbol, Variable
from gyrocal.variables.shapes import Columns, Shape


def _along(component: int) -> Symbol:
    def values(run: Run, axis: int) -> Array | None:
        acc_g = acceleration_g(run)
        return None if acc_g is None else acc_g[:, component]

    return Symbol(f"acceleration along {AXES[component]}, g", values)


class Acceleration(Variable):
    name, title, quantity, unit, order = "acceleration", "Accel.", "acceleration", "g", 6
    components = AXES
    symbols: ClassVar = {f"a{name}": _along(i) for i, name in enumerate(AXES)}
    searched = tuple(symbols)

    def values(self, run: Run, axis: int) -> Array | None:
        return acceleration_g(run)

    def shapes(self, axis: int) -> list[Shape]:
        if not pose_changes(self.runs):
            return []
        return [Columns(acceleration_g, len(AXES), "in proportion to the acceleration")]
