"""The smallest error of scale and bias that is possible in the campaign ``table2`` after a few seconds.

No estimator that knows the campaign's distributions has a smaller expected squared error than the mean of the posterior.
Scale, bias, ripple, size of the transient and noise are Gaussian and are integrated out in closed form. The transient's time
constant is summed over a grid with weights by evidence.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gyrocal.calibration.estimator import Calibration, Column, Posterior
from gyrocal.calibration.scenarios import Protocol, answers
from gyrocal.effects import base
from gyrocal.noise.whitening import Noise
from gyrocal.recording.session import Array
from gyrocal.simulation.campaigns import RIPPLE, TRANSIENT
from gyrocal.simulation.simulate import (
    BIAS_MEAN_DPS,
    BIAS_SD_DPS,
    LOG_TAU,
    LSB_DPS,
    OU_SD_DPS,
    OU_TAU_S,
    RATE_HZ,
    RIPPLE_SD_DPS,
    SCALE_MEAN,
    SCALE_SD,
    TABLE_RATE_DPS,
    TRANSIENT_SD_DPS,
    TURN_ON_SD_DPS,
    WHITE_SD_DPS,
)

PROTOCOL = Protocol(RATE_HZ, TABLE_RATE_DPS)
GRID = 24
"""Number of values of each run's time constant. With 48 the answers change by less than 1e-3 of their errors."""


def table2(grid: int = GRID) -> Calibration:
    """The prior distribution of a scenario of ``table2``, for the z axis."""
    ripple, spin_up = base.effect(RIPPLE), base.effect(TRANSIENT)
    taus_s = np.exp(LOG_TAU[0] + np.diff(LOG_TAU)[0] * (np.arange(grid) + 0.5) / grid)
    columns = [
        *(Column(ripple, {"amplitude_1": 0.0}, i, 0.0, RIPPLE_SD_DPS / TABLE_RATE_DPS) for i in range(2)),
        *(Column(spin_up, {"A": 0.0, "tau_s": float(t)}, 0, 0.0, TRANSIENT_SD_DPS / TABLE_RATE_DPS) for t in taus_s),
    ]
    white = float(np.sqrt(WHITE_SD_DPS**2 + LSB_DPS**2 / 12))
    return Calibration(
        "table2", "z", tuple(columns), (), (BIAS_MEAN_DPS, float(np.hypot(BIAS_SD_DPS, TURN_ON_SD_DPS))),
        (SCALE_MEAN, SCALE_SD), Noise(white, OU_SD_DPS, OU_TAU_S), grid,
    )  # fmt: skip


def flat(calibration: Calibration) -> Calibration:
    """The same with flat priors of scale and bias, for a sensor that has not been measured before."""
    return replace(calibration, bias_dps=(0.0, np.inf), scale=(0.0, np.inf))


def limit(up_dps: Array, down_dps: Array, seconds: float, grid: int = GRID, *, known: bool = True) -> Posterior:
    """The posterior of scale and bias from every sample of the first ``seconds``.

    ``up_dps`` and ``down_dps`` [n, samples] are measured minus true rates of scenarios of ``table2``. The priors of scale and
    bias are the campaign's with ``known``, otherwise flat.
    """
    calibration = table2(grid) if known else flat(table2(grid))
    return answers(calibration, up_dps, down_dps, seconds, PROTOCOL, by_sample=True)
