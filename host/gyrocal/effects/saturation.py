"""The rate exceeds what the sensor can show."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gyrocal.effects.base import Effect, Parameter
from gyrocal.session import Array, Run


class Saturation(Effect):
    id = "saturation"
    title = "Clipping at full scale"
    cause = (
        "The rate, with its noise and vibration, goes beyond the range that the chip is set to, and the reading "
        "stays at the limit. Near the limit only the peaks are cut, so the mean falls short a little: a scale "
        "error of the fastest run alone."
    )
    equation = "min(max(y, -full_scale_dps), full_scale_dps) - y"
    looks_like = "scale_nonlinearity, which bends gradually from the middle of the range"
    measure_next = "the same rate at the next larger range of the chip"
    parameters = (
        Parameter(
            "full_scale_dps", "dps", (125.0, 2000.0), "LSM6DSO datasheet, table 2: ranges of 125-2000 dps", 125.0
        ),
    )

    def axes(self, run: Run) -> tuple[int, ...]:
        return (0, 1, 2)

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return np.zeros((len(run), 0))

    def distort(self, run: Run, y_dps: Array, values: Mapping[str, float], rng: np.random.Generator) -> Array:
        """The readings [n, 3] with this fault, deg/s."""
        return np.clip(y_dps, -values["full_scale_dps"], values["full_scale_dps"])
