"""How large a wave of unknown phase is in each run, and the odds that its size follows the law of its effect.

A tone of the table has one size, and a ripple of its speed one that grows with the rate. Both may have another size in each
run, as on a table that is loaded anew. But a wave whose phase is free follows any disturbance over less than two turns. There
it must have the size that its law says, for a disturbance has another one in each run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gyrocal.effects.wave import ONE_RATE
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.reml import integrate
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

GRID = 0.05
"""Step of the logarithm of the size over which the likelihoods are integrated."""
FURTHEST = 5.0
"""Ratio by which the sizes that are tried reach beyond those that were found."""


@dataclass(frozen=True)
class WaveSizes:
    """Sizes [runs, orders] of a wave in the runs that show it, each fitted apart, their errors, and the rates [runs], deg/s."""

    size_dps: Array
    error_dps: Array
    rate_dps: Array

    @staticmethod
    def of(fitted: AxisFit, own: Sequence[int], rate_power: float) -> WaveSizes:
        """The sizes of a wave with the columns ``own`` [2 k] of each run, a cosine and a sine for each order.

        In deg/s, the columns grow with the rate to ``rate_power``.
        """
        layout, pairs = fitted.design.layout, np.reshape(own, (-1, 2))
        random, sd = layout.random, fitted.spreads.of(layout)
        left = np.concatenate([[1.0], -fitted.solution.beta, np.zeros(len(layout.run))])  # what the shared columns leave
        at, found, rates_dps = np.arange(random.size), [], []
        for block, gram in zip(fitted.design.blocks, fitted.grams, strict=True):
            rate_dps = float(np.sqrt(np.mean(block.run.rate_dps**2)))
            if rate_dps == 0 or np.any(np.diagonal(gram)[random[pairs]] <= 0):
                continue
            columns = np.vstack([left, np.eye(left.size)[random]])
            sums = columns @ gram @ columns.T
            one_run = []
            for pair in pairs:
                others = np.setdiff1d(at, pair)
                alone = integrate(sums, 1 + others, np.concatenate([[0], 1 + pair]), sd[others]).grams
                one_run.append(_size(alone[1:, 0], alone[1:, 1:]))
            found.append(np.array(one_run) * rate_dps**rate_power)
            rates_dps.append(rate_dps)
        size, error = np.moveaxis(np.reshape(found, (-1, len(pairs), 2)), 2, 0)
        return WaveSizes(size, error, np.array(rates_dps))

    def log_odds(self, rate_power: float, *, exact: bool) -> float:
        """Log odds that the size grows with the rate to ``rate_power``, which is 0 or 1, over the law of the other number.

        With ``exact``, it grows so from run to run, and another size in each run counts against it. Else that is granted to
        both laws, whose mean squares then differ.
        """
        if self.size_dps.size == 0:
            return 0.0
        several = bool(np.ptp(self.rate_dps) >= ONE_RATE * self.rate_dps.max())
        other = 1.0 - rate_power
        own, rival = [self._integrated(_of_law, rate_power)], [self._integrated(_of_law, other)] * several
        own_at_random, at_random = self._integrated(_at_random, rate_power), [self._integrated(_at_random, other)] * several
        if not exact:
            own, rival = [*own, own_at_random], [*rival, *at_random]
        else:
            rival = [*rival, *(one - np.log(1 + several) for one in (own_at_random, *at_random))]
        return float(np.logaddexp.reduce(own) - np.logaddexp.reduce(rival)) if rival else 0.0

    def _integrated(self, loglik: Callable[[Array, Array, Array], Array], power: float) -> float:
        """The logarithm of a likelihood, integrated over the logarithm of each order's size."""
        growth = (self.rate_dps / np.exp(np.mean(np.log(self.rate_dps)))) ** power
        strongest = float(np.sqrt(np.mean(self.size_dps**2, axis=0)).max())
        errors, total = np.hypot(self.error_dps, POLICY.size_within * strongest), 0.0
        for size, error in zip(self.size_dps.T, errors.T, strict=True):
            low, high = min(error.min(), size.max()) / FURTHEST, max(error.min(), size.max()) * FURTHEST
            tried = np.exp(np.arange(np.log(low), np.log(high) + GRID, GRID))
            total += float(np.logaddexp.reduce(loglik(tried[:, None] * growth, size, error).sum(axis=1))) - np.log(tried.size)
        return total


def _size(products: Array, information: Array) -> tuple[float, float]:
    """Amplitude and its error from the normal equations of a cosine and a sine, as if both were known equally well."""
    precision = float(np.trace(information)) / 2
    root = np.linalg.cholesky(information + 1e-9 * precision * np.eye(2))
    return float(np.linalg.norm(np.linalg.solve(root, products)) / np.sqrt(precision)), float(1 / np.sqrt(precision))


def _of_law(expected: Array, size: Array, error: Array) -> Array:
    """Log-likelihood of a size (Rice's distribution, less terms that every law shares) at an expected one."""
    from scipy.special import ive

    variance = error**2
    return np.asarray(np.log(ive(0, size * expected / variance)) - (size - expected) ** 2 / (2 * variance) - np.log(variance))


def _at_random(expected: Array, size: Array, error: Array) -> Array:
    """Log-likelihood of a size (Rayleigh's distribution, less the same terms) if its mean square is the expected one's."""
    variance = error**2 + expected**2 / 2
    return np.asarray(-np.log(variance) - size**2 / (2 * variance))
