"""The angle of the table."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial
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
LEAST_PERIOD = 0.75
"""Part of a period through which the table must turn in some run, so that a wave of it is looked for."""
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
        if not any(turns(self.runs, table_axis) for table_axis in range(3)):
            return []
        orders = self._spanned
        if all(r.column("table_angle_deg") is not None for r in self.runs):
            return [Waves(partial(_waves, orders=orders), orders)] if orders else []
        return [TableWave(k) for k in orders if turns(self.runs, axis) or self._seen(axis, k)]

    @cached_property
    def _spanned(self) -> list[int]:
        """The orders of which the table turns through most of a period in some run: a small part of a wave is any curve."""
        turned = max(map(_turned, self.runs))
        return [k for k in range(1, ORDERS + 1) if k * turned >= LEAST_PERIOD]

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


def _turned(run: Run) -> float:
    """How far the table turns in a run, from its lowest to its highest angle, in turns."""
    angle = table_angle_rad(run)
    known = np.unwrap(angle[np.isfinite(angle)])
    return float(np.ptp(known)) / (2 * np.pi) if known.size else 0.0


def _waves(run: Run, orders: Sequence[int]) -> Array:
    """Cosine and sine of each order about their means over the run; zero where the run turns through too little of a period.

    A wave through the angles of runs that stand would describe any offsets of theirs.
    """
    angle, turned = table_angle_rad(run), _turned(run)
    columns = np.column_stack([wave(k * angle) for k in orders for wave in (np.cos, np.sin)])
    shown = np.repeat([k * turned >= LEAST_PERIOD for k in orders], 2)
    return np.asarray((columns - np.nanmean(columns, axis=0)) * shown)
