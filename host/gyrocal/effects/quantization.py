"""Steps of the reading that are coarser than the session says."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gyrocal.effects.base import Effect, Parameter
from gyrocal.session import Array, Run


class Quantization(Effect):
    id = "quantization"
    title = "Coarse steps"
    cause = (
        "The readings sit on a grid that is coarser than one count should be: the chip is set to a larger range "
        "than thought, low bits are lost in a conversion or a shift, or the log was written with few digits. "
        "Where noise is smaller than a step, averaging no longer helps."
    )
    equation = "lsb_dps·round(y/lsb_dps) - y"
    looks_like = (
        "white noise of lsb_dps/√12, as long as the noise is larger than a step; a stuck bit, which leaves a step out"
    )
    measure_next = (
        "a histogram of the readings at rest: read the range register back and compare its count with the grid"
    )
    parameters = (
        Parameter(
            "lsb_dps",
            "dps",
            (0.004375, 0.07),
            "LSM6DSO datasheet, table 2: 4.375-70 mdps a count at 125-2000 dps",
            0.07,
        ),
    )

    def axes(self, run: Run) -> tuple[int, ...]:
        return (0, 1, 2)

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return np.zeros((len(run), 0))

    def distort(self, run: Run, y_dps: Array, values: Mapping[str, float], rng: np.random.Generator) -> Array:
        """The readings [n, 3] with this fault, deg/s."""
        return np.round(y_dps / values["lsb_dps"]) * values["lsb_dps"]
