"""The smooth level of a spectrum: the noise between the lines, as the sensor's low-pass, aliasing and 1/f noise shape it.

The logarithm of the level is a cubic B-spline of frequency with a penalty on its second differences (P-spline; Eilers and Marx,
Stat. Sci. 11 (1996) 89), fitted by Whittle's likelihood: an averaged periodogram is Gamma-distributed about the level. The
penalty maximises the marginal likelihood, so white noise gets a straight line and a filter's knee gets its bend.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyrocal import tails
from gyrocal.recording.session import Array

CELLS = 400
"""Ordinates are pooled in about so many cells before the fit. A level changes little within a cell."""
KNOTS_PER_OCTAVE = 3.0
WIDEST_KNOT = 1 / 16
"""Largest distance of knots as a fraction of the highest frequency. Aliasing bends the level just below it."""
PENALTIES = np.geomspace(1e-2, 1e6, 13)
LINE = 1e-4
"""Probability under noise below which a value is taken for a line's and left out of the fit."""
ROUNDS = 3
NEWTON_STEPS = 25


@dataclass(frozen=True)
class SmoothLevel:
    """Level [f] in the unit of the power, and the variance [f] of its logarithm."""

    level: Array
    variance: Array


def smooth_level(frequency_hz: Array, power: Array, shape: float, pad: int) -> SmoothLevel:
    """Fit the level of a power spectrum [f] whose values are Gamma-distributed with ``shape`` about it.

    ``pad`` is the zero-padding factor: so many neighbouring values count as one. Lines are left out of the fit.
    """
    cell = _cells(frequency_hz)
    basis, penalty = _basis(_coordinate(frequency_hz))
    count = np.bincount(cell)
    per_cell = np.array([np.bincount(cell, column) for column in basis.T]).T / count[:, None]
    order = np.lexsort((power, cell))
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    median = power[order][first + (count - 1) // 2] / (tails.chi_square_value(0.5, 2 * shape) / (2 * shape))
    start = np.log(np.maximum(median, np.finfo(np.float64).tiny))
    fit = _fit(per_cell, penalty, np.exp(start), np.maximum(count / pad, 1.0))
    for _ in range(ROUNDS):
        level = np.exp(basis @ fit.coefficients)
        line = tails.chi_square(2 * shape * power / level, 2 * shape) < LINE
        for _ in range(2 * pad):
            line = line | np.roll(line, 1) | np.roll(line, -1)
        kept = np.bincount(cell, ~line)
        mean = np.bincount(cell, np.where(line, 0.0, power)) / np.maximum(kept, 1)
        fit = _fit(per_cell, penalty, mean, shape * kept / pad, fit.coefficients)
    covariance = np.linalg.pinv(fit.information)
    variance = np.einsum("ci,ij,cj->c", per_cell, covariance, per_cell)[cell]
    return SmoothLevel(np.exp(basis @ fit.coefficients), np.maximum(variance, 0.0))


def _coordinate(frequency_hz: Array) -> Array:
    """Frequency in knots [f]: logarithmic up to where a knot is ``WIDEST_KNOT`` wide, linear above."""
    top = float(frequency_hz[-1])
    turn = min(max(WIDEST_KNOT * top * KNOTS_PER_OCTAVE / np.log(2), float(frequency_hz[0])), top)
    low = KNOTS_PER_OCTAVE * np.log2(np.minimum(frequency_hz, turn) / frequency_hz[0])
    return np.asarray(low + np.maximum(frequency_hz - turn, 0.0) / (WIDEST_KNOT * top))


def _cells(frequency_hz: Array) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Number of the cell of each frequency [f], without empty cells."""
    u = _coordinate(frequency_hz)
    raw = np.floor(u / max(float(u[-1]), 1e-300) * (CELLS - 1e-9)).astype(np.intp)
    return np.unique(raw, return_inverse=True)[1].astype(np.intp).reshape(-1)


def _basis(u: Array) -> tuple[Array, Array]:
    """Cubic B-splines [f, k] with knots at whole numbers of u [f], and the penalty [k, k] on their second differences."""
    from scipy.interpolate import BSpline

    spans = max(1, int(np.ceil(float(u[-1]) - 1e-9)))
    knots = np.arange(-3, spans + 4, dtype=np.float64)
    basis = BSpline.design_matrix(np.clip(u, 0.0, spans), knots, 3).toarray()
    bend = np.diff(np.eye(basis.shape[1]), n=2, axis=0)
    return basis, bend.T @ bend


@dataclass(frozen=True)
class _Penalised:
    coefficients: Array
    information: Array
    evidence: float


def _fit(basis: Array, penalty: Array, mean: Array, weight: Array, start: Array | None = None) -> _Penalised:
    """The coefficients at the penalty with the largest marginal likelihood (Laplace's approximation)."""
    best: _Penalised | None = None
    for size in PENALTIES[::-1]:
        tried = _at_penalty(basis, size * penalty, float(size), mean, weight, start)
        start = tried.coefficients
        if best is not None and tried.evidence < best.evidence - 5.0:
            break
        if best is None or tried.evidence > best.evidence:
            best = tried
    assert best is not None
    return best


def _at_penalty(basis: Array, penalty: Array, size: float, mean: Array, weight: Array, start: Array | None) -> _Penalised:
    used = weight > 0
    basis, mean, weight = basis[used], np.maximum(mean[used], np.finfo(np.float64).tiny), weight[used]
    ridge = 1e-9 * float(weight.sum()) * np.eye(penalty.shape[0])
    expected = (basis * weight[:, None]).T @ basis + penalty + ridge  # Fisher's information, the same at any level
    x = np.asarray(np.linalg.solve(expected, basis.T @ (weight * np.log(mean))), dtype=np.float64) if start is None else start

    def cost(x: Array) -> float:
        eta = basis @ x
        return float(weight @ (eta + mean * np.exp(np.minimum(-eta, 600.0))) + 0.5 * x @ penalty @ x)

    at = cost(x)
    for _ in range(NEWTON_STEPS):
        eta = basis @ x
        ratio = mean * np.exp(-eta)
        slope = basis.T @ (weight * (1 - ratio)) + penalty @ x
        step = np.linalg.solve(expected, slope)
        while (moved := cost(x - step)) > at + 1e-9 * abs(at) and np.abs(step).max() > 1e-9:
            step = step / 2
        x, gained, at = x - step, at - moved, moved
        if gained < 1e-4:
            break
    logdet = float(np.linalg.slogdet(expected)[1])
    rank = penalty.shape[0] - 2
    return _Penalised(x, expected, -at + 0.5 * rank * float(np.log(size)) - 0.5 * logdet)
