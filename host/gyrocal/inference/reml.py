"""Restricted maximum likelihood (REML) of a design whose random coefficients are integrated out.

This file needs only the whitened normal equations ("Gram matrices") of each run. Spreads, held-out runs and competing models
are all computed from these small matrices.

Reference: Harville, J. Am. Stat. Assoc. 72 (1977) 320, for REML in mixed linear models.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from gyrocal.effects.base import Role
from gyrocal.inference.design import Design
from gyrocal.inference.layout import Layout
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

Index = np.ndarray[Any, np.dtype[np.signedinteger[Any]]]

TOLERANCE = 1e-3
"""A search for noise and spreads ends when a step gains less log-likelihood."""
FIRST_STEP = 0.5
"""Length of the first step of a search in its coordinates, which are logarithms of ratios."""
NO_SPREAD = 1e-6
"""A variance below this fraction of the variance with which one run determines the coefficient counts as zero."""
LARGEST_SPREAD: dict[Role | None, float] = {
    Role.BIAS: POLICY.largest_bias_spread_dps, Role.SCALE: POLICY.largest_scale_spread
}  # fmt: skip
"""Largest standard deviation over power cycles, deg/s and a fraction."""


@dataclass(frozen=True)
class Spreads:
    """Standard deviations of random coefficients: ``run`` for each group of columns of each run, ``scenario`` for each column
    that is random from power cycle to power cycle.
    """

    run: Array
    scenario: Array

    def of(self, layout: Layout) -> Array:
        """The standard deviation of each of the layout's :attr:`~Layout.random` columns."""
        return np.concatenate([self.run[list(layout.run_group)], self.scenario])


@dataclass(frozen=True)
class Solution:
    """The solution for given spreads: REML log-likelihood, ``beta`` [p], its covariance [p, p] and chi-square."""

    loglik: float
    beta: Array
    cov: Array
    chi2: float


@dataclass(frozen=True)
class Integrated:
    """Gram matrices with random coefficients integrated out.

    The expectation of the standardised coefficients is ``v = weights (y, -X)``. ``inverse`` is the covariance of v given the
    other coefficients. There is one of each for every Gram matrix.
    """

    grams: Array
    logdet: Array
    weights: Array
    inverse: Array


def integrate(gram: Array, index: Index, keep: Index, sd: Array) -> Integrated:
    """Integrate out the coefficients ``~ N(0, sd^2)`` of the columns ``index``. The columns ``keep`` remain."""
    b = sd[:, None] * gram[..., index, :][..., keep]
    m = np.eye(index.size) + sd[:, None] * gram[..., index, :][..., index] * sd
    chol = np.linalg.cholesky(m)
    root = np.linalg.inv(chol)
    half = root @ b
    logdet = 2 * np.log(np.diagonal(chol, axis1=-2, axis2=-1)).sum(axis=-1)
    transposed = root.swapaxes(-1, -2)
    kept = gram[..., keep, :][..., keep] - half.swapaxes(-1, -2) @ half
    return Integrated(kept, logdet, transposed @ half, transposed @ root)


@dataclass(frozen=True)
class _Solved:
    """A solution with its integrated coefficients. ``grams`` has one matrix for each power cycle, or for each run if no
    coefficient varies over power cycles.
    """

    solution: Solution
    grams: Array
    of_runs: Integrated | None
    of_scenarios: Integrated | None


def solve(layout: Layout, grams: Array, logdet: Array, scenarios: Index, n: int, spreads: Spreads) -> Solution:
    """Integrate out the random coefficients and solve for the shared ones."""
    return _solve(layout, grams, logdet, _members(scenarios), n, spreads).solution


def _members(scenarios: Index) -> Array:
    """Matrix [cycles, runs] that is 1 if the run belongs to the power cycle, else 0."""
    return (np.unique(scenarios)[:, None] == scenarios).astype(float)


def _solve(layout: Layout, grams: Array, logdet: Array, members: Array, n: int, spreads: Spreads) -> _Solved:
    p = len(layout.fixed)
    total_logdet = float(logdet.sum())
    keep = np.arange(1 + p)
    of_runs = of_scenarios = None
    if layout.run:
        of_runs = integrate(grams, np.arange(1 + p, grams.shape[-1]), keep, spreads.run[list(layout.run_group)])
        grams = of_runs.grams
        total_logdet += float(of_runs.logdet.sum())
    if layout.scenario:
        summed = (members @ grams.reshape(grams.shape[0], -1)).reshape(-1, 1 + p, 1 + p)
        of_scenarios = integrate(summed, np.array(layout.scenario) + 1, keep, spreads.scenario)
        grams = of_scenarios.grams
        total_logdet += float(of_scenarios.logdet.sum())
    total = grams.sum(axis=0)
    h, g = total[1:, 1:], total[1:, 0]
    scale = np.sqrt(np.maximum(np.diag(h), 1e-300))
    try:
        chol = np.linalg.cholesky(h / np.outer(scale, scale))
    except np.linalg.LinAlgError:
        nothing = Solution(-np.inf, np.full(p, np.nan), np.full((p, p), np.nan), np.nan)
        return _Solved(nothing, grams, of_runs, of_scenarios)
    inverse_chol = np.linalg.inv(chol)
    half = inverse_chol @ (g / scale)
    cov = (inverse_chol.T @ inverse_chol) / np.outer(scale, scale)
    beta = inverse_chol.T @ half / scale
    chi2 = float(total[0, 0] - half @ half)
    logdet_h = 2 * float(np.log(np.diag(chol)).sum() + np.log(scale).sum())
    loglik = -0.5 * (total_logdet + logdet_h + chi2 + (n - p) * np.log(2 * np.pi))
    return _Solved(Solution(loglik, beta, cov, chi2), grams, of_runs, of_scenarios)


def solve_with_slopes(
    layout: Layout, grams: Array, logdet: Array, scenarios: Index, n: int, spreads: Spreads
) -> tuple[Solution, Array]:
    """The solution, and the derivatives of its log-likelihood by the logarithm of each spread, those of runs first.

    By Fisher's identity the derivative is the sum of E[v^2 | y] - 1 over the coefficients that share a spread, where v is the
    coefficient divided by its spread.
    """
    p, members = len(layout.fixed), _members(scenarios)
    solved = _solve(layout, grams, logdet, members, n, spreads)
    slope_run, slope_scenario = np.zeros(spreads.run.size), np.zeros(spreads.scenario.size)
    if not np.isfinite(solved.solution.loglik):
        return solved.solution, np.concatenate([slope_run, slope_scenario])
    beta, cov = solved.solution.beta, solved.solution.cov
    center, spread = np.broadcast_to(beta, (1, p)), cov[None]
    of_scenarios, cycles = solved.of_scenarios, solved.grams.shape[0]
    if of_scenarios is not None:
        slope_scenario = _slopes(of_scenarios, center, spread).sum(axis=0)
        pull = np.zeros((cycles, p, 1 + p))  # the coefficients of a power cycle: beta plus their random part
        pull[:, layout.scenario] = spreads.scenario[:, None] * of_scenarios.weights
        own = np.eye(p) - pull[:, :, 1:]
        random = np.zeros((cycles, p, p))
        rows = np.ix_(range(cycles), layout.scenario, layout.scenario)
        random[rows] = spreads.scenario[:, None] * of_scenarios.inverse * spreads.scenario
        which = members.argmax(axis=0)
        center = (own @ beta + pull[:, :, 0])[which]
        spread = (own @ cov @ own.swapaxes(-1, -2) + random)[which]
    if solved.of_runs is not None:
        np.add.at(slope_run, list(layout.run_group), _slopes(solved.of_runs, center, spread).sum(axis=0))
    return solved.solution, np.concatenate([slope_run, slope_scenario])


def _slopes(of: Integrated, center: Array, spread: Array) -> Array:
    """E[v^2 | y] - 1 for the coefficients that were integrated out, shape [grams, k]."""
    b = of.weights[..., 1:]
    v = of.weights[..., 0] - (b @ center[..., None])[..., 0]
    variance = np.diagonal(of.inverse, axis1=-2, axis2=-1) + np.einsum("...ij,...jk,...ik->...i", b, spread, b)
    return np.asarray(v**2 + variance - 1)


@dataclass(frozen=True)
class SpreadScale:
    """Spreads as search coordinates ``log(1 + (sd / unit)^2)``: the variance for small spreads, else its logarithm.

    ``unit`` [k] is the standard error with which one run (or power cycle) alone determines its coefficient. For spreads far
    below it, the likelihood is linear in the variance but flat in the logarithm, where a search would not converge.
    """

    unit: Array
    high: Array

    @staticmethod
    def of(design: Design, grams: Array) -> SpreadScale:
        layout = design.layout
        information = np.zeros(layout.n_groups + len(layout.scenario))
        diagonal = np.diagonal(grams, axis1=-2, axis2=-1)
        per_run = diagonal[:, 1 + len(layout.fixed) :].mean(axis=0)
        for group in range(layout.n_groups):
            information[group] = np.mean([per_run[j] for j, g in enumerate(layout.run_group) if g == group])
        cycles = np.unique(design.scenarios).size
        information[layout.n_groups :] = diagonal[:, np.array(layout.scenario, dtype=np.intp) + 1].sum(axis=0) / cycles
        unit = np.where(information > 0, 1 / np.sqrt(np.maximum(information, 1e-300)), 0.0)
        largest = np.where(unit > 0, _largest_dps(design) / np.concatenate(_random_rms(design)), 0.0)
        limits = [LARGEST_SPREAD[design.terms[layout.fixed[j][0]].effect.role] for j in layout.scenario]
        largest[layout.n_groups :] = np.minimum(largest[layout.n_groups :], limits)
        return SpreadScale(unit, np.log1p((largest / np.maximum(unit, 1e-300)) ** 2))

    def coordinates(self, sd: Array) -> Array:
        """Coordinates [k] of spreads [k]. A spread that is not known yet (NaN) starts at its unit."""
        given = np.where(np.isnan(sd), self.unit, sd)
        ratio = np.divide(given, self.unit, out=np.zeros_like(given), where=self.unit > 0)
        return np.clip(np.log1p(ratio**2), NO_SPREAD, np.maximum(self.high, NO_SPREAD))

    def spreads(self, x: Array) -> Array:
        return self.unit * np.sqrt(np.expm1(x))

    def slopes(self, x: Array, of_log_sd: Array) -> Array:
        """Derivatives by the coordinates, from derivatives by log sd."""
        return of_log_sd / (-2 * np.expm1(-x))

    def settled(self, x: Array) -> Array:
        """The spreads at the end of a search. A vanishing spread is set to zero."""
        return np.where(x > 10 * NO_SPREAD, self.spreads(x), 0.0)

    @property
    def bounds(self) -> list[tuple[float, float]]:
        return [(NO_SPREAD, max(float(h), NO_SPREAD)) for h in self.high]


def maximise(loglik: Callable[[Array], tuple[float, Array]], x0: Array, bounds: list[tuple[float, float]]) -> Array:
    """The coordinates of the maximum of a log-likelihood, which is given with its derivatives.

    L-BFGS-B goes the whole gradient in its first step if every coordinate is bounded. The gradient of a log-likelihood grows
    with the data, so that step would end in a corner of the bounds. The cost is therefore scaled to a gradient of
    ``FIRST_STEP``.
    """
    from scipy.optimize import minimize

    value, slope = loglik(x0)
    scale = FIRST_STEP / max(float(np.linalg.norm(slope)), FIRST_STEP) if np.isfinite(value) else 1.0

    def cost(x: Array) -> tuple[float, Array]:
        value, slope = loglik(x)
        return (-scale * value, -scale * slope) if np.isfinite(value) else (1e300, np.zeros_like(x))

    enough = TOLERANCE * scale / max(scale * abs(value), 1.0) if np.isfinite(value) else TOLERANCE
    found = minimize(cost, x0, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 60, "ftol": enough})
    return np.asarray(found.x)


def fit_spreads(design: Design, grams: Array, logdet: Array, scenarios: Index, n: int, start: Spreads) -> Spreads:
    """Estimate only the spreads by REML. Spreads of ``start`` that are NaN are not known yet."""
    k = start.run.size
    if k + start.scenario.size == 0:
        return start
    scale = SpreadScale.of(design, grams)

    def loglik(x: Array) -> tuple[float, Array]:
        sd = scale.spreads(x)
        solution, slopes = solve_with_slopes(design.layout, grams, logdet, scenarios, n, Spreads(sd[:k], sd[k:]))
        return solution.loglik, scale.slopes(x, slopes)

    x = maximise(loglik, scale.coordinates(np.concatenate([start.run, start.scenario])), scale.bounds)
    sd = scale.settled(x)
    return Spreads(sd[:k], sd[k:])


def _random_rms(design: Design) -> tuple[Array, Array]:
    rms = design.column_rms
    p = len(design.layout.fixed)
    run = np.array([
        np.mean([rms[1 + p + j] for j, g in enumerate(design.layout.run_group) if g == group])
        for group in range(design.layout.n_groups)
    ])  # fmt: skip
    return run, rms[np.array(design.layout.scenario, dtype=np.intp) + 1]


def unknown_spreads(design: Design) -> Spreads:
    layout = design.layout
    return Spreads(np.full(layout.n_groups, np.nan), np.full(len(layout.scenario), np.nan))


def _largest_dps(design: Design) -> float:
    """Upper limits of the spreads: ten times the standard deviation of the readings."""
    return 10 * float(design.column_rms[0]) + 1e-3
