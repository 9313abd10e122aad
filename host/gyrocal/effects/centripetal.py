"""Centripetal acceleration of a sensor that is not on the axis of rotation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gyrocal.effects.base import AtSample, Case, Effect, Law, Parameter, stack
from gyrocal.effects.mistaken import square_of_slope
from gyrocal.effects.quantities import TURNING_AT_ALL, true_rate_dps, turns
from gyrocal.recording.session import Array, Run


class Centripetal(Effect):
    id = "centripetal"
    title = "Centripetal acceleration"
    cause = (
        "A sensor off the table's axis is accelerated inwards by w^2 times its distance. Its sensitivity to "
        "acceleration turns this into a rate on any of its axes. At 0.1 m and 150 dps the acceleration is 0.07 g. The "
        "error grows with the square of the rate and has the same sign in both directions. Vibration of the table that "
        "the sensor rectifies behaves in the same way."
    )
    equation = "k·w^2, where w is the table's rate about any axis"
    looks_like = (
        "scale_asymmetry, if there are only rest and one speed; bias, at one speed; g_sensitivity, if "
        "acceleration is recorded"
    )
    measure_next = (
        "three different speeds including rest, or a run with the sensor on the axis of rotation, where the effect vanishes"
    )
    parameters = (
        Parameter("k", "1/dps", (1e-8, 3e-6), "0.01-0.1 dps/g at 0.03-1 m from the axis: 3.1e-5·(dps/g)·m", 1e-6),
    )
    linear = ("k",)
    on_device = True
    law = Law({"k": 1e-6}, "1e-6*rate**2", degree=2, even=True)
    cases = (Case({"k": 2e-6}, ("k",), "full"),)

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        return None if any(turns(runs, table_axis) for table_axis in range(3)) else TURNING_AT_ALL

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return stack(true_rate_dps(run) ** 2)

    def at_sample(self, values: Mapping[str, float]) -> AtSample:
        k = values["k"]
        return lambda rate_dps, temp_c, power_on_s, acc_g: k * rate_dps * rate_dps

    def passes_for_it(self, runs: Sequence[Run], axis: int) -> Sequence[Effect]:
        return [square_of_slope()]
