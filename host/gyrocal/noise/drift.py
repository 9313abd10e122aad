"""Drift: slow random variation of the bias, modelled as an Ornstein-Uhlenbeck process."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gyrocal.noise.component import NoiseComponent
from gyrocal.parameter import NOT_NEGATIVE, POSITIVE, Parameter
from gyrocal.recording.session import Array


@dataclass(frozen=True)
class Drift(NoiseComponent):
    """Drift with standard deviation ``sd_dps`` (deg/s) and correlation time ``tau_s`` (s), independent from run to run.

    ``known`` says that a fit does not search for the drift: its standard deviation over that of one sample's white noise, and
    its correlation time in s.
    """

    id = "colored_noise"
    title = "Colored noise (bias instability)"
    cause = (
        "Flicker noise of the electronics and creep of the package make the bias wander slowly. This drift is modelled as an "
        "Ornstein-Uhlenbeck process, which for a long time constant is a random walk. Averaging longer does not remove it."
    )
    equation = "an Ornstein-Uhlenbeck process with standard deviation sd_dps and correlation time tau_s"
    looks_like = "any slow deterministic effect; an effect repeats from run to run, noise does not"
    measure_next = "a long run at rest; the minimum of its Allan deviation gives the size"
    parameters = (
        Parameter(
            "sd_dps", "dps", (0.0005, 0.01), "MEMS gyroscopes' bias instability, 2-20 deg/h and more", 0.003, NOT_NEGATIVE
        ),
        Parameter("tau_s", "s", (5.0, 300.0), "where the Allan deviation turns up", 30.0, POSITIVE, sized=False),
    )
    field_name = "drift"

    sd_dps: float | None = None
    tau_s: float | None = None
    known: tuple[float, float] | None = field(default=None, kw_only=True)

    def sample(self, n: int, dt_s: float, rng: np.random.Generator) -> Array:
        return self.samples(n, dt_s, 1, rng)[:, 0]

    def samples(self, n: int, dt_s: float, columns: int, rng: np.random.Generator) -> Array:
        """Independent realisations at ``n`` samples ``dt_s`` seconds apart, shape [n, columns], deg/s."""
        assert self.sd_dps is not None
        assert self.tau_s is not None
        return ou_noise(n, dt_s, self.sd_dps, self.tau_s, columns, rng)


def ou_noise(n: int, dt_s: float, sd: float, tau_s: float, columns: int, rng: np.random.Generator) -> Array:
    """Independent stationary Ornstein-Uhlenbeck processes in columns, shape [n, columns], in the unit of ``sd``."""
    from scipy.signal import lfilter

    phi = np.exp(-dt_s / tau_s)
    shocks = rng.normal(0.0, sd * np.sqrt(1 - phi**2), (n, columns))
    shocks[0] = rng.normal(0.0, sd, columns)
    return np.asarray(lfilter([1.0], [1.0, -phi], shocks, axis=0))
