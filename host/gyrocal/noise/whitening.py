"""White noise plus a slow Ornstein-Uhlenbeck drift: whitened normal equations of block means.

Ordinary least squares takes drift for an effect in a third to a half of all sessions that hold none; generalised least squares
with this covariance does not. The cost is O(n): a tridiagonal matrix is all that is solved. Where drift is slow against the
white noise, it may be taken as constant for a while, and another noise level costs as much as there are such whiles.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gyrocal.recording.session import Array

AT_ONCE = 2**17
"""Numbers that are solved for at once, about: they stay in the processor's cache."""


@dataclass(frozen=True)
class Noise:
    """``white_sd_dps`` is one sample's; the drift has spread ``ou_sd_dps`` and correlation time ``ou_tau_s``."""

    white_sd_dps: float
    ou_sd_dps: float = 0.0
    ou_tau_s: float = 30.0


@dataclass(frozen=True)
class Summed:
    """Columns of runs that share their blocks' times, summed as far as no noise level matters: :meth:`normal_equations`.

    ``gram`` [runs, q, q] over all blocks; ``means`` [runs, q, k] over cells of time in which drift is taken to be constant,
    ``t_s`` [k] their mean times, ``n`` [k] the samples in them; ``blocks``, ``log_n``: number of blocks and sum of log n.
    """

    gram: Array
    means: Array
    t_s: Array
    n: Array
    blocks: int
    log_n: float

    @staticmethod
    def of(columns: Iterable[Array], t_s: Array, n: Array, cell_s: float = 0.0) -> Summed:
        """``columns`` [q, m] of each run: q columns of m block means at times ``t_s`` [m] of ``n`` [m] samples each.

        ``cell_s`` = 0: every block is a cell of its own, and the normal equations are exact.
        """
        blocks, log_n = t_s.size, float(np.log(n).sum())
        even = np.ptp(n) == 0
        cell = np.floor((t_s - t_s[0]) / cell_s) if cell_s > 0 else np.arange(blocks)
        start = np.flatnonzero(np.concatenate([[True], np.diff(cell) > 0]))
        exact = start.size == blocks
        total = n if exact else np.add.reduceat(n, start)
        grams, means = [], []
        for one in columns:
            weighted = one if even else one * n
            grams.append(weighted @ one.T * (n[0] if even else 1.0))
            means.append(
                one if exact else np.add.reduceat(weighted, start, axis=-1) * ((n[0] if even else 1.0) / total)
            )
        centre_s = t_s if exact else np.add.reduceat(t_s * n, start) / total
        return Summed(np.stack(grams), np.stack(means), centre_s, total, blocks, log_n)

    def of_columns(self, rows: np.ndarray[Any, np.dtype[np.intp]]) -> Summed:
        """The same with some of the columns alone."""
        return replace(self, gram=self.gram[:, rows][:, :, rows], means=self.means.take(rows, axis=1))

    def normal_equations(self, noise: Noise) -> tuple[Array, float]:
        """``C V^-1 C'`` of each run [runs, q, q] and ``log det V`` of one, V the noise's covariance.

        White noise is a diagonal matrix D, and the drift's inverse covariance Q is tridiagonal, for it is a Markov process; it
        starts stationary in each run. By Woodbury's identity ``V^-1 = D^-1 - D^-1 Z (Q + Z' D^-1 Z)^-1 Z' D^-1``, Z the cell
        that a block is in, so gaps and unequal blocks cost no more than even ones.
        """
        from scipy.linalg.lapack import dpttrf, dpttrs

        precision = 1 / noise.white_sd_dps**2
        gram = self.gram * precision
        logdet = -self.blocks * float(np.log(precision)) - self.log_n
        if noise.ou_sd_dps <= 0.0:
            return gram, logdet
        variance = noise.ou_sd_dps**2
        steps = np.diff(self.t_s) / noise.ou_tau_s
        phi, driven = np.exp(-steps), -variance * np.expm1(-2 * steps)
        diagonal = self.n * precision
        diagonal[0] += 1 / variance
        diagonal[1:] += 1 / driven
        diagonal[:-1] += phi**2 / driven
        coupling = np.zeros(max(1, phi.size))  # LAPACK wants one even where there is a single cell
        coupling[: phi.size] = -phi / driven
        pivots, factors, _ = dpttrf(diagonal, coupling)
        even = np.ptp(self.n) == 0
        sums, scale = (self.means, float(self.n[0])) if even else (self.means * self.n, 1.0)
        runs = max(1, AT_ONCE // (sums.shape[1] * self.t_s.size))
        for first in range(0, len(sums), runs):
            some = sums[first : first + runs]
            drift = dpttrs(pivots, factors, some.reshape(-1, self.t_s.size).T)[0].T.reshape(some.shape)
            gram[first : first + runs] -= (scale * precision) ** 2 * (some @ drift.swapaxes(-1, -2))
        logdet += float(np.log(variance) + np.log(driven).sum() + np.log(pivots).sum())
        return gram, logdet


def normal_equations(columns: Array, t_s: Array, n: Array, noise: Noise) -> tuple[Array, float]:
    """Of columns [runs, q, m] as :class:`Summed` takes them, exact: [runs, q, q], and the log-determinant of one run."""
    return Summed.of(columns, t_s, n).normal_equations(noise)
