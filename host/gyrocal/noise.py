"""White noise plus a slow Ornstein-Uhlenbeck drift: whitened normal equations of block means.

Ordinary least squares takes drift for an effect in a third to a half of all sessions that hold none; generalised least squares
with this covariance does not. The Kalman filter of the drift whitens any column in one pass, so the cost is O(n).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyrocal.session import Array


@dataclass(frozen=True)
class Noise:
    """``white_sd_dps`` is one sample's; the drift has spread ``ou_sd_dps`` and correlation time ``ou_tau_s``."""

    white_sd_dps: float
    ou_sd_dps: float = 0.0
    ou_tau_s: float = 30.0


def normal_equations(columns: Array, t_s: Array, n: Array, noise: Noise) -> tuple[Array, float]:
    """``C V^-1 C'`` and ``log det V`` for the noise's covariance V.

    ``columns`` [runs, q, m]: q columns of m block means, for runs that share the blocks' times ``t_s`` [m] and counts
    ``n`` [m]. Returns [runs, q, q] and the log-determinant of one run. The drift starts stationary in each run.
    """
    r = noise.white_sd_dps**2 / n
    if noise.ou_sd_dps <= 0.0:
        return (columns / r) @ columns.swapaxes(-1, -2), float(np.log(r).sum())
    steps = np.diff(t_s)
    even = t_s.size > 2 and np.ptp(n) == 0 and np.ptp(steps) <= 0.02 * steps.mean()
    return (_even if even else _uneven)(columns, t_s, r, noise)


def _even(columns: Array, t_s: Array, r: Array, noise: Noise) -> tuple[Array, float]:
    """Evenly spaced blocks: the filter's steady state is one recursive filter.

    The steady state knows the drift at the first block better than we do: the rest of our ignorance about it is one random
    coefficient of the column phi^k, integrated out. That is exact.
    """
    from scipy.signal import lfilter

    m = t_s.size
    variance, white = noise.ou_sd_dps**2, float(r[0])
    phi = float(np.exp(-np.diff(t_s).mean() / noise.ou_tau_s))
    q = (1 - phi**2) * variance
    b = white * (1 - phi**2) - q  # p^2 + b p - q white = 0 is the steady state's variance before a measurement
    p = 2 * q * white / (b + np.sqrt(b * b + 4 * q * white))
    gain, s = p / (p + white), p + white
    start = np.broadcast_to(phi ** np.arange(m), (*columns.shape[:-2], 1, m))
    both = np.concatenate([columns, start], axis=-2)
    predicted = lfilter([0.0, phi * gain], [1.0, -phi * (1 - gain)], both, axis=-1)
    innovations = (both - predicted) / np.sqrt(s)
    gram = innovations @ innovations.swapaxes(-1, -2)
    extra = max(variance - p, 0.0)
    edge = gram[..., :-1, -1]
    total = 1 + extra * float(gram.reshape(-1, *gram.shape[-2:])[0, -1, -1])
    gram = gram[..., :-1, :-1] - edge[..., :, None] * edge[..., None, :] * (extra / total)
    return gram, m * float(np.log(s)) + float(np.log(total))


def _uneven(columns: Array, t_s: Array, r: Array, noise: Noise) -> tuple[Array, float]:
    """Gaps or unequal blocks: the Kalman filter step by step."""
    variance = noise.ou_sd_dps**2
    phi = np.exp(-np.diff(t_s, append=t_s[-1:]) / noise.ou_tau_s)
    innovations = np.empty_like(columns)
    state = np.zeros(columns.shape[:-1])
    p, logdet = variance, 0.0
    for k in range(t_s.size):
        s = p + r[k]
        gain = p / s
        error = columns[..., k] - state
        innovations[..., k] = error / np.sqrt(s)
        logdet += float(np.log(s))
        state = phi[k] * (state + gain * error)
        p = phi[k] ** 2 * (p - gain * p) + (1 - phi[k] ** 2) * variance
    return innovations @ innovations.swapaxes(-1, -2), logdet
