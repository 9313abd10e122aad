"""The value of the reading itself, which shows wrongly assembled bits."""

from __future__ import annotations

from gyrocal.recording.session import Array, Run
from gyrocal.variables.base import Variable


class Reading(Variable):
    name, title, quantity, unit, order = "reading", "Reading", "reading", "dps", 7
    of_axis = True
    no_formula = "bits of the reading are wrong, which no formula can correct; check how the driver assembles the bytes"

    def values(self, run: Run, axis: int) -> Array:
        return run.gyro_dps[:, axis]
