"""Dependence of the scale on the magnitude of the rate, equal in both directions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gyrocal.effects.base import AtSample, Case, Effect, Law, Parameter, stack
from gyrocal.effects.quantities import TURNING, rate_about, turns
from gyrocal.recording.session import Array, Run


class ScaleNonlinearity(Effect):
    id = "scale_nonlinearity"
    title = "Nonlinearity of the scale"
    cause = (
        "The capacitors that sense the mass and the amplifiers behind them are slightly nonlinear. Towards full "
        "scale the reading is too small or too large by the same amount in both directions. A scale measured at one "
        "rate is wrong at another."
    )
    equation = "k3·w^3"
    looks_like = "scale, if there is only one rate and its opposite; saturation, if only the fastest run deviates"
    measure_next = "two or more rates in both directions, one of them near full scale"
    parameters = (
        Parameter(
            "k3",
            "1/dps^2",
            (3e-9, 1e-7),
            "consumer MEMS gyroscopes: 0.01-0.2 % of full scale at 250 dps (IEEE Std 1431: linearity)",
            3e-8,
        ),
    )
    linear = ("k3",)
    on_device = True
    law = Law({"k3": 3e-8}, "3e-8*rate**3", degree=3)
    cases = (Case({"k3": 3e-8}, ("k3",), "full"),)

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        return None if turns(runs, axis) else TURNING

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        w_dps = rate_about(run, axis)
        return stack(w_dps * w_dps * w_dps)

    def at_sample(self, values: Mapping[str, float]) -> AtSample:
        k3 = values["k3"]
        return lambda rate_dps, temp_c, power_on_s, acc_g: k3 * rate_dps * rate_dps * rate_dps
