"""The noise of one sample, by the median of successive differences, which slow errors and outliers hardly change."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gyrocal.recording.run import Run
from gyrocal.recording.session import Array
from gyrocal.tails import ROBUST


def sample_sd_dps(readings: Sequence[Array]) -> float:
    """Standard deviation of one sample's white noise in the readings [n] of runs, less what moves them, deg/s."""
    steps = np.concatenate([np.abs(np.diff(values)) for values in readings])
    return ROBUST * float(np.median(steps)) / 2**0.5


def weight_beside(samples: Array, white_sd_dps: float, shared_sd_dps: float) -> Array:
    """The part of its information that a mean of ``samples`` [n] keeps beside an error that they share, [n]."""
    return 1 / (1 + samples * (shared_sd_dps / white_sd_dps) ** 2)


def white_sd_dps(runs: Sequence[Run], axis: int) -> float:
    """The same of an axis, beside what follows the true rate; at least the noise of rounding, deg/s."""
    rounding = max(float(r.step_dps[axis]) for r in runs) / 12**0.5
    return max(sample_sd_dps([r.beside_rate_dps(axis) for r in runs]), rounding) or 1e-9
