"""Bias: the reading of the gyroscope at rest."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gyrocal.effects.base import AtSample, Effect, Law, Parameter, Role
from gyrocal.recording.session import Array, Run


class Bias(Effect):
    id = "bias"
    title = "Bias"
    cause = (
        "The drive and sense paths of the part are never perfectly balanced: quadrature leakage and amplifier offsets leave a "
        "constant reading at rest. A bias of 0.1 dps integrates to a heading error of 6 degrees in a minute."
    )
    equation = "bias_dps"
    looks_like = "the vertical component of the Earth's rate (0.004 dps), which only the latitude separates from it"
    measure_next = "a run at rest, or two runs of opposite true rate"
    parameters = (
        Parameter("bias_dps", "dps", (0.02, 1.0), "LSM6DSO datasheet, table 2: zero-rate level +-1 dps", -0.05),
    )
    linear = ("bias_dps",)
    role = Role.BIAS
    law = Law({"bias_dps": -0.2}, "-0.2")

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return np.ones((len(run), 1))

    def at_sample(self, values: Mapping[str, float]) -> AtSample:
        bias_dps = values["bias_dps"]
        return lambda rate_dps, temp_c, power_on_s, acc_g: bias_dps
