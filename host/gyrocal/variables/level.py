"""The size of the rate, without its direction."""

from __future__ import annotations

import numpy as np

from gyrocal.effects.quantities import noise_of_rate_dps, rate_about, rate_varies
from gyrocal.recording.session import Array, Run
from gyrocal.variables.base import Variable
from gyrocal.variables.shapes import Shape, Steps

EDGES_DPS = (0.3, 1.0, 3.0, 10.0, 30.0)
"""Small rates may be lost (a dead band), so that the steps are narrow towards zero, deg/s."""

LARGEST_NOISE_DPS = 0.015
"""With more noise than this, a reference does not know small rates to a few percent: a twentieth of the first edge, deg/s."""


class Level(Variable):
    """The size of the true rate about the axis. Small and large rates are tested for a scale of their own."""

    name, title, quantity, unit, order = "level", "Size of the rate", "size of the true rate", "dps", 11
    of_axis = True
    no_formula = "the scale differs between small and large rates; search against the rate"

    def values(self, run: Run, axis: int) -> Array:
        return np.abs(rate_about(run, axis))

    def shapes(self, axis: int) -> list[Shape]:
        if not rate_varies(self.runs, axis):
            return []
        largest_dps = max(float(self.values(r, axis).max(initial=0.0)) for r in self.runs)
        if max(map(noise_of_rate_dps, self.runs), default=0.0) > LARGEST_NOISE_DPS:
            return []
        edges = np.array([e for e in EDGES_DPS if e < 0.5 * largest_dps])
        return [Steps(lambda run: self.values(run, axis), edges, times_rate=True, unit=self.unit)] if edges.size else []
