"""The bias of each power cycle differs a little."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gyrocal.effects.base import Effect, Parameter, Values
from gyrocal.recording.session import Array, Run


class TurnOnBias(Effect):
    id = "turn_on_bias"
    title = "Turn-on bias"
    cause = (
        "Each time the part is powered its drive loop and its charge distribution settle a little differently, so the bias has "
        "a new value in every power cycle. It is random: a calibration of yesterday cannot remove it, one after power-on can."
    )
    equation = "one random offset a scenario, spread sd_dps"
    looks_like = "bias_temperature when the room differs between power cycles"
    measure_next = "more power cycles at one temperature"
    parameters = (Parameter("sd_dps", "dps", (0.002, 0.05), "MEMS gyroscopes' turn-on repeatability", 0.01),)
    linear = ("sd_dps",)
    scope = "scenario"

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return np.ones((len(run), 1))

    def coefficients(self, values: Mapping[str, float]) -> Array:
        return np.zeros(1)

    def spread(self, values: Mapping[str, float]) -> Array:
        return np.array([values.get("sd_dps", 0.0)])

    def named_spread(self, spread: Array, values: Mapping[str, float]) -> Values:
        return {"sd_dps": float(spread[0])}
