"""The sensor sits off the axis of rotation, and the centripetal acceleration leaks in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gyrocal.effects.base import Effect, Parameter, stack
from gyrocal.effects.quantities import TURNING, rate_about, turns
from gyrocal.session import Array, Run


class Centripetal(Effect):
    id = "centripetal"
    title = "Centripetal acceleration"
    cause = (
        "Off the table's axis the sensor is pulled inwards by w^2 times its distance, and its sensitivity to "
        "acceleration turns that into a rate. At 0.1 m and 150 dps that is 0.07 g. The error grows with the "
        "square of the rate, alike in both directions."
    )
    equation = "k·w^2"
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

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        return None if turns(runs, axis) else TURNING

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return stack(rate_about(run, axis) ** 2)
