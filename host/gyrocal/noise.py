"""White noise plus a slow Ornstein-Uhlenbeck drift: whitened normal equations of block means.

Ordinary least squares takes drift for an effect in a third to a half of all sessions that hold none; generalised least squares
with this covariance does not. The cost is O(n): a tridiagonal matrix is all that is solved.
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

    White noise is a diagonal matrix D, and the drift's inverse covariance Q is tridiagonal, for it is a Markov process. By
    Woodbury's identity ``V^-1 = D^-1 - D^-1 (Q + D^-1)^-1 D^-1``, so gaps and unequal blocks cost no more than even ones.
    """
    from scipy.linalg.lapack import dpttrf, dpttrs

    weight = n / noise.white_sd_dps**2
    weighted = columns * weight
    gram = weighted @ columns.swapaxes(-1, -2)
    logdet = -float(np.log(weight).sum())
    if noise.ou_sd_dps <= 0.0:
        return gram, logdet
    variance, m = noise.ou_sd_dps**2, t_s.size
    steps = np.diff(t_s) / noise.ou_tau_s
    phi, driven = np.exp(-steps), -variance * np.expm1(-2 * steps)
    diagonal = weight.copy()
    diagonal[0] += 1 / variance
    diagonal[1:] += 1 / driven
    diagonal[:-1] += phi**2 / driven
    pivots, factors, _ = dpttrf(diagonal, -phi / driven)
    right = weighted.reshape(-1, m)
    drift = dpttrs(pivots, factors, right.T)[0].T.reshape(columns.shape)
    logdet += float(np.log(variance) + np.log(driven).sum() + np.log(pivots).sum())
    return gram - weighted @ drift.swapaxes(-1, -2), logdet
