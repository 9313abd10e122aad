"""The angle of the table."""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar

import numpy as np

from gyrocal.effects.base import table_angle_rad
from gyrocal.effects.order_tone import spectrum_over_turns
from gyrocal.effects.quantities import turns
from gyrocal.noise.orders import OrderSpectrum
from gyrocal.recording.session import Array, Run
from gyrocal.variables import terms
from gyrocal.variables.base import Symbol, Variable
from gyrocal.variables.shapes import Shape, TableWave, Waves

FIRST_SIGHT = 0.01
"""Probability under noise above which a wave on an axis across the table's is not tried."""
WHOLE_TURN_DEG = 360.0
"""A table whose angle covers less swings, and nothing comes back once per turn."""
ORDERS = 6
"""Largest number of periods per turn that is tested."""


class TableAngle(Variable):
    """The table's angle, measured or integrated from its rate. It is tested on every axis."""

    name, title, quantity, unit, order = "table_angle", "Table angle", "table angle", "deg", 5
    period = 360.0
    letters = ("th",)
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
        if not any(turns(self.runs, table_axis) for table_axis in range(3)) or not any(map(_goes_round, self.runs)):
            return []
        if all(r.column("table_angle_deg") is not None for r in self.runs):
            return [Waves(_waves, range(1, ORDERS + 1))]
        return [TableWave(k) for k in range(1, ORDERS + 1) if turns(self.runs, axis) or self._seen(axis, k)]

    @cached_property
    def _spectra(self) -> list[OrderSpectrum]:
        return [spectrum_over_turns(self.runs, axis) for axis in range(3)]

    def _seen(self, axis: int, order: int) -> bool:
        """False if the spectrum over turns of the readings shows nothing near this order, so that no fit is tried."""
        found = self._spectra[axis]
        near = np.abs(found.order - order) < 1 / max(found.turns, 1.0)
        return not near.any() or float(found.tail[near].min()) < FIRST_SIGHT

    def terms(self, symbol: str, values: Array) -> list[str]:
        return terms.of_turns(symbol, "theta")


def _goes_round(run: Run) -> bool:
    """True if the table's angle covers a whole turn in a run."""
    if not (np.any(run.rate_dps) or run.column("table_angle_deg") is not None):
        return False
    angle_deg = np.rad2deg(table_angle_rad(run))
    angle_deg = np.unwrap(angle_deg[np.isfinite(angle_deg)], period=360.0)
    return angle_deg.size > 0 and float(np.ptp(angle_deg)) >= WHOLE_TURN_DEG


def _waves(run: Run) -> Array:
    angle = table_angle_rad(run)
    return np.column_stack([wave(k * angle) for k in range(1, ORDERS + 1) for wave in (np.cos, np.sin)])
