"""The sensor sits off the axis of rotation, and the centripetal acceleration leaks in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gyrocal.effects.base import Case, Effect, Law, Parameter, stack
from gyrocal.effects.quantities import TURNING_AT_ALL, turns
from gyrocal.recording.session import Array, Run


class Centripetal(Effect):
    id = "centripetal"
    title = "Centripetal acceleration"
    cause = (
        "Off the table's axis the sensor is pulled inwards by w^2 times its distance, and its sensitivity to "
        "acceleration turns that into a rate, on any of its axes. At 0.1 m and 150 dps that is 0.07 g. The error "
        "grows with the square of the rate, alike in both directions; so does what a table's vibration leaves when "
        "the sensor rectifies it."
    )
    equation = "k·w^2, with w the table's rate, about whichever axis"
    looks_like = (
        "scale_asymmetry, where there is only rest and one speed; bias, at one speed; g_sensitivity, if "
        "acceleration is recorded"
    )
    measure_next = (
        "three different speeds, rest among them; or move the sensor onto the axis of rotation and see it vanish"
    )
    parameters = (
        Parameter("k", "1/dps", (1e-8, 1e-6), "0.01-0.1 dps/g at 0.03-0.3 m from the axis: 3.1e-5·(dps/g)·m", 1e-6),
    )
    linear = ("k",)
    on_device = True
    law = Law({"k": 1e-6}, "1e-6*rate**2", degree=2, even=True)
    cases = (Case({"k": 2e-6}, ("k",), "full"),)

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        return None if any(turns(runs, table_axis) for table_axis in range(3)) else TURNING_AT_ALL

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return stack(run.rate_dps**2)
