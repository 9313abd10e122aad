"""The states that the noise of an axis may be in, and each one's sums with everything integrated out that is no hypothesis.

The level of the noise is integrated exactly (Student's t). Drift and the spreads of bias and scale over power cycles are summed
over a grid: the noise of the model without an effect is no measure of them, because it has swallowed the effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from gyrocal.effects.base import Role
from gyrocal.evidence.matrix import Index, Matrix
from gyrocal.noise.whitening import Noise
from gyrocal.recording.session import Array

DRIFTS = (0.25, 0.6, 1.5, 3.5, 8.0)
"""Standard deviations of the drift, in standard deviations of the white noise's mean over a second."""
TIMES_S = (6.0, 25.0, 100.0, 400.0, 1600.0)
"""Correlation times of the drift, as far as they are shorter than the longest run."""
BIAS_SPREADS_DPS = (3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0)
SCALE_SPREADS = (3e-5, 1e-4, 3e-4, 1e-3, 3e-3)
"""Spreads of bias and scale over power cycles."""
ABSENT = 0.5
"""Probability that a component of the noise is absent."""
LEAST_NORM = 1e-9


@dataclass(frozen=True, eq=False)
class States:
    """The states [s] of one axis: products [s, q, q] of reading and hypotheses, and logarithms [s] of weights.

    Row 0 is the reading. Columns that are no hypothesis are zero. ``degrees`` are those of freedom of chi-square.
    """

    products: Array
    log_weight: Array
    degrees: int
    noises: tuple[Noise, ...]
    """The noise [s] of each state."""
    spreads: tuple[tuple[float, ...], ...]
    """The spreads [s] of the columns of power cycles."""

    @staticmethod
    def of(matrix: Matrix) -> States:
        """All states of an axis."""
        products, weights, noises, spreads = [], [], [], []
        for noise, log_prior in _drifts(matrix):
            grams, logdet = matrix.grams(noise)
            own = matrix.of_runs
            if own.size:
                sd = matrix.fit.spreads.run[list(matrix.design.layout.run_group)]
                grams, of_runs = integrated(grams, own, sd)
                logdet = logdet + of_runs
            cycles = _by_cycle(grams, matrix.design.scenarios)
            for sd_of_cycles, log_of_spread in _spreads(matrix):
                apart, of_cycles = integrated(cycles, matrix.of_cycles, np.array(sd_of_cycles))
                total, of_shared = without(apart.sum(axis=0), matrix.shared)
                products.append(total)
                weights.append(log_prior + log_of_spread - 0.5 * (float(logdet.sum()) + float(of_cycles.sum()) + of_shared))
                noises.append(noise)
                spreads.append(sd_of_cycles)
        degrees = matrix.n - matrix.shared.size
        return States(np.array(products), np.array(weights), degrees, tuple(noises), tuple(spreads))


def factor(information: Array) -> Array:
    """Cholesky factors [..., k, k] of information with a prior, whose eigenvalues are 1 at least.

    Where the expected noise of measured columns was more than is there, what is left of the data says nothing.
    """
    try:
        return np.asarray(np.linalg.cholesky(information))
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(information)
        known = (vectors * np.maximum(values, 1.0)[..., None, :]) @ vectors.swapaxes(-1, -2)
        return np.asarray(np.linalg.cholesky(known))


def integrated(grams: Array, columns: Index, sd: Array) -> tuple[Array, Array]:
    """Products [r, q, q] without ``columns`` [k] whose coefficients are ~ N(0, sd^2), and log-determinants [r]."""
    if not columns.size or not np.any(sd):
        return grams, np.zeros(len(grams))
    rows = sd[:, None] * grams[:, columns]
    chol = factor(np.eye(columns.size) + rows[:, :, columns] * sd)
    half = np.linalg.solve(chol, rows)
    return grams - half.swapaxes(-1, -2) @ half, 2 * np.log(np.diagonal(chol, axis1=1, axis2=2)).sum(axis=1)


def without(gram: Array, columns: Index) -> tuple[Array, float]:
    """Products [q, q] without ``columns`` [k] whose coefficients are free, and the log-determinant."""
    out, logdet = gram.copy(), 0.0
    for j in columns.tolist():
        norm = float(out[j, j])
        if norm > LEAST_NORM * float(gram[j, j]):
            out -= np.outer(out[j], out[j] / norm)
            logdet += float(np.log(norm))
        out[j], out[:, j] = 0.0, 0.0
    return out, logdet


def _by_cycle(grams: Array, scenarios: Index) -> Array:
    out = np.zeros((int(scenarios.max()) + 1, *grams.shape[1:]))
    np.add.at(out, scenarios, grams)
    return out


def _drifts(matrix: Matrix) -> list[tuple[Noise, float]]:
    """The states of drift with the logarithm of their probability."""
    fit = matrix.fit
    white = matrix.white_sd_dps
    of_model = fit.design.noise_model.drift
    if of_model is None or of_model.known is not None:
        return [(fit.noise.times(white / fit.noise.white_sd_dps), 0.0)]
    longest_s, second = fit.design.extent_s[0], matrix.second_dps
    times_s = [t for t in TIMES_S if t <= max(longest_s, TIMES_S[0])]
    states = [(Noise(white), float(np.log(ABSENT)))]
    each = float(np.log((1 - ABSENT) / (len(DRIFTS) * len(times_s))))
    return states + [(Noise(white, size * second, tau_s), each) for size, tau_s in product(DRIFTS, times_s)]


def _spreads(matrix: Matrix) -> list[tuple[tuple[float, ...], float]]:
    """The spreads of the columns of power cycles, with the logarithm of their probability."""
    bias = matrix.role(Role.BIAS)
    grids = [_grid(BIAS_SPREADS_DPS if j == bias else SCALE_SPREADS) for j in matrix.of_cycles.tolist()]
    return [(tuple(value for value, _ in chosen), sum(log for _, log in chosen)) for chosen in product(*grids)]


def _grid(values: Sequence[float]) -> list[tuple[float, float]]:
    each = float(np.log((1 - ABSENT) / len(values)))
    return [(0.0, float(np.log(ABSENT))), *((value, each) for value in values)]
