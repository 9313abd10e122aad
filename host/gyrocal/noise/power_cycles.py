"""Power cycles: bias and scale are a little different each time the part is powered."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyrocal.noise.component import NoiseComponent
from gyrocal.parameter import NOT_NEGATIVE, Parameter
from gyrocal.recording.session import Array


@dataclass(frozen=True)
class TurnOnBias(NoiseComponent):
    """A random offset of each power cycle, of spread ``sd_dps`` (deg/s)."""

    id = "turn_on_bias"
    title = "Turn-on bias"
    cause = (
        "Each time the part is powered its drive loop and its charge distribution settle a little differently, so the bias has "
        "a new value in every power cycle. It is random: a calibration of yesterday cannot remove it, one after power-on can."
    )
    equation = "one random offset a scenario, spread sd_dps"
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
    """A random scale of each power cycle, of spread ``sd`` (a fraction) with standard error ``se``.

    It is fitted beside :class:`TurnOnBias` where each power cycle holds two true rates; the model file and the commands give it
    as the spread of the scale, ``scale_sd``.
    """

    sd: float
    se: float | None = None
