"""Scale error: the first term of eq. (4)."""

from __future__ import annotations

from collections.abc import Mapping

from gyrocal.effects.base import Effect, Law, Parameter, Role
from gyrocal.effects.quantities import rate_about
from gyrocal.recording.session import Array, Run


class Scale(Effect):
    id = "scale"
    title = "Scale error"
    cause = (
        "The sensitivity in the datasheet is a nominal value. The actual value differs by up to about a percent between parts "
        "and axes, and soldering changes it. The reading is proportional to the true rate with a slightly wrong factor."
    )
    equation = "scale·w"
    looks_like = "an error of the table's own rate, which gyroscope data cannot separate from it"
    measure_next = "runs at two or more true rates; check the table's rate with a stopwatch over many turns"
    parameters = (
        Parameter("scale", "fraction", (0.001, 0.02), "LSM6DSO datasheet, table 2: sensitivity tolerance +-1 %", 0.004),
    )
    linear = ("scale",)
    is_gain = True
    role = Role.SCALE
    law = Law({"scale": 0.003}, "0.003*rate", degree=1)

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return rate_about(run, axis)[:, None]
