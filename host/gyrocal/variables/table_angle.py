"""The angle of the table."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gyrocal.effects.base import table_angle_rad
from gyrocal.effects.quantities import turns
from gyrocal.recording.session import Array, Run
from gyrocal.variables import terms
from gyrocal.variables.base import Symbol, Variable
from gyrocal.variables.shapes import Shape, TableWave, Waves

ORDERS = 6
"""Largest number of periods per turn that is tested."""


class TableAngle(Variable):
    """The table's angle, measured or integrated from its rate. It is tested on every axis."""

    name, title, quantity, unit, order = "table_angle", "Table angle", "table angle", "deg", 5
    period = 360.0
    symbols: ClassVar = {
        "theta": Symbol("the table's angle, rad", lambda run, axis: table_angle_rad(run)),
        "turn": Symbol(
            "the table's angle as a fraction of a turn, 0 to 1", lambda run, axis: table_angle_rad(run) / (2 * np.pi) % 1.0
        ),
    }
    searched = ("turn",)

    def values(self, run: Run, axis: int) -> Array | None:
        turned = bool(np.any(run.rate_dps)) or run.column("table_angle_deg") is not None
        return np.rad2deg(table_angle_rad(run)) if turned else None

    def shapes(self, axis: int) -> list[Shape]:
        if not any(turns(self.runs, table_axis) for table_axis in range(3)):
            return []
        if all(r.column("table_angle_deg") is not None for r in self.runs):
            return [Waves(_waves, range(1, ORDERS + 1))]
        return [TableWave(k) for k in range(1, ORDERS + 1)]

    def terms(self, symbol: str, values: Array) -> list[str]:
        return terms.of_turns(symbol, "theta")


def _waves(run: Run) -> Array:
    angle = table_angle_rad(run)
    return np.column_stack([wave(k * angle) for k in range(1, ORDERS + 1) for wave in (np.cos, np.sin)])
