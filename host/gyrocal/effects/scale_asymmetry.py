"""Difference of the scale between clockwise and anticlockwise rotation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gyrocal.effects.base import AtSample, Case, Effect, Law, Parameter, stack
from gyrocal.effects.mistaken import square_of_slope
from gyrocal.effects.quantities import rate_about, turned, turns
from gyrocal.recording.session import Array, Run


class ScaleAsymmetry(Effect):
    id = "scale_asymmetry"
    title = "Asymmetry of the scale"
    cause = (
        "The gain differs between the two directions of rotation, for example because two opposing electrodes are "
        "not equal. The reading over the rate consists of two straight lines with a kink at rest. At a single speed "
        "the effect looks like a bias."
    )
    equation = "k·abs(w)"
    looks_like = "bias, if the table turns at one speed only; centripetal, if there are only rest and one speed"
    measure_next = "a run at rest and two different speeds in both directions"
    parameters = (
        Parameter(
            "k", "fraction", (1e-4, 0.002), "MEMS gyroscopes' scale asymmetry, 0.01-0.2 % (IEEE Std 1431)", 0.001
        ),
    )
    linear = ("k",)
    on_device = True
    law = Law({"k": 0.001}, "0.001*abs(rate)", degree=1, even=True)
    cases = (Case({"k": 0.001}, ("k",), "full"),)

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        both = "a run in which the table turns about this axis at a known rate, or turns by known angles in both directions"
        return None if turns(runs, axis) or len(turned(runs, axis)) > 1 else both

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return stack(np.abs(rate_about(run, axis)))

    def at_sample(self, values: Mapping[str, float]) -> AtSample:
        k = values["k"]
        return lambda rate_dps, temp_c, power_on_s, acc_g: k * abs(rate_dps)
    def passes_for_it(self, runs: Sequence[Run], axis: int) -> Sequence[Effect]:
        return [square_of_slope()]
