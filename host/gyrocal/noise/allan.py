"""Overlapping Allan deviation, and that of the noise model.

White noise of spread sigma a sample at rate f: ``sigma / sqrt(f tau)``. An Ornstein-Uhlenbeck drift of spread s and correlation
time T: ``s^2 (2 T / tau) (1 - T/(2 tau) (3 - 4 exp(-tau/T) + exp(-2 tau/T)))`` for its square. IEEE Std 952-1997, annex C.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gyrocal.noise.whitening import Noise
from gyrocal.recording.session import Array


def averaging_factors(n: int, per_decade: int = 8) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Whole numbers of samples from 1 to n/3, evenly in their logarithm."""
    top = max(1, n // 3)
    count = max(2, round(per_decade * np.log10(top)) + 1)
    return np.unique(np.geomspace(1, top, count).round().astype(np.intp))


def allan_deviation(series: Sequence[Array], rate_hz: float) -> tuple[Array, Array]:
    """Overlapping Allan deviation pooled over series [n] of a rate, deg/s: averaging times [k] in s, deviations [k]."""
    factors = averaging_factors(max(s.size for s in series))
    times, deviations = [], []
    for m in factors:
        total, count = 0.0, 0
        for s in series:
            if s.size >= 3 * m:
                angle = np.concatenate([[0.0], np.cumsum(s)])
                second = angle[2 * m :] - 2 * angle[m:-m] + angle[: -2 * m]
                total += float(np.sum(second**2))
                count += second.size
        if count:
            times.append(m / rate_hz)
            deviations.append(np.sqrt(total / (2 * m**2 * count)))
    return np.array(times), np.array(deviations)


def model_deviation(tau_s: Array, noise: Noise, rate_hz: float) -> Array:
    """Allan deviation that the noise model predicts at averaging times ``tau_s`` [k], deg/s."""
    white = noise.white_sd_dps**2 / (rate_hz * tau_s)
    if noise.ou_sd_dps == 0:
        return np.sqrt(white)
    x = tau_s / noise.ou_tau_s
    shape = np.where(
        x > 1e-3, (2 / x) * (1 - (3 - 4 * np.exp(-x) + np.exp(-2 * x)) / (2 * np.maximum(x, 1e-3))), 2 * x / 3
    )
    return np.sqrt(white + noise.ou_sd_dps**2 * shape)
