"""Noise that wanders: slow drift of the bias beyond white noise."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gyrocal.effects.base import Effect, Parameter
from gyrocal.recording.session import Array, Run


class ColoredNoise(Effect):
    id = "colored_noise"
    title = "Colored noise (bias instability)"
    cause = (
        "Besides white noise the bias wanders slowly: flicker of the electronics, creep of the package. It is modelled as an "
        "Ornstein-Uhlenbeck process, which for a long time constant is a random walk. Averaging longer does not remove it."
    )
    equation = "an Ornstein-Uhlenbeck process of spread sd_dps and correlation time tau_s"
    looks_like = "any slow deterministic effect, which repeats from run to run where noise does not"
    measure_next = "a long run at rest: the Allan deviation's floor is its size"
    parameters = (
        Parameter("sd_dps", "dps", (0.0005, 0.01), "MEMS gyroscopes' bias instability, 2-20 deg/h and more", 0.003),
        Parameter("tau_s", "s", (5.0, 300.0), "where the Allan deviation turns up", 30.0),
    )
    linear = ()
    nonlinear = ("sd_dps", "tau_s")
    scope = "run"

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return np.zeros((len(run), 0))
