"""Power cycles: bias and scale change slightly each time the part is powered."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyrocal.noise.component import NoiseComponent
from gyrocal.parameter import NOT_NEGATIVE, Parameter
from gyrocal.recording.session import Array


@dataclass(frozen=True)
class TurnOnBias(NoiseComponent):
    """A random offset in each power cycle, with standard deviation ``sd_dps`` (deg/s)."""

    id = "turn_on_bias"
    title = "Turn-on bias"
    cause = (
        "Each time the part is powered, its drive loop and its charge distribution settle slightly differently, so the bias "
        "has a new random value in every power cycle. A calibration after power-on removes it, an earlier calibration cannot."
    )
    equation = "one random offset in each power cycle, standard deviation sd_dps"
    looks_like = "bias_temperature when the room differs between power cycles"
    measure_next = "more power cycles at one temperature"
    parameters = (Parameter("sd_dps", "dps", (0.002, 0.05), "MEMS gyroscopes' turn-on repeatability", 0.01, NOT_NEGATIVE),)
    field_name = "turn_on_bias"
    one_draw = True

    sd_dps: float | None = None

    def sample(self, n: int, dt_s: float, rng: np.random.Generator) -> Array:
        return np.full(n, self.draw_dps(rng))

    def draw_dps(self, rng: np.random.Generator) -> float:
        """The offset of one power cycle, deg/s."""
        assert self.sd_dps is not None
        return rng.normal(0.0, self.sd_dps)


@dataclass(frozen=True)
class TurnOnScale:
    """A random scale error in each power cycle, with standard deviation ``sd`` (a fraction) and its standard error ``se``.

    It is fitted together with :class:`TurnOnBias` if each power cycle contains two true rates. The model file and the commands
    give it as ``scale_sd``, the spread of the scale.
    """

    sd: float
    se: float | None = None
