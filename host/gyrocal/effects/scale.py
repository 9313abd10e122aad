"""Scale error: the first term of eq. (4)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gyrocal.effects.base import Effect, Parameter
from gyrocal.recording.session import Array, Run


class Scale(Effect):
    id = "scale"
    title = "Scale error"
    cause = (
        "The sensitivity printed in the datasheet is a nominal value: each part, each axis and each soldering shifts it by "
        "up to a percent or so. The reading is proportional to the true rate, with a slightly wrong factor."
    )
    equation = "scale·w"
    looks_like = "an error of the table's own rate, which no gyroscope data can tell from it"
    measure_next = "runs at two true rates at least; check the table's rate with a stopwatch over many turns"
    parameters = (
        Parameter("scale", "fraction", (0.001, 0.02), "LSM6DSO datasheet, table 2: sensitivity tolerance +-1 %", 0.004),
        Parameter("scale_sd", "fraction", (0.0, 0.001), "repeatability from one power cycle to the next", 0.0),
    )
    linear = ("scale",)

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return (run.rate_dps if axis == run.axis_index else np.zeros(len(run)))[:, None]
