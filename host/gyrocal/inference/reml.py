"""Restricted maximum likelihood (REML) of a design whose random coefficients are integrated out.

This file needs only the whitened normal equations ("Gram matrices") of each run. Spreads, held-out runs and competing models
are all computed from these small matrices.

Reference: Harville, J. Am. Stat. Assoc. 72 (1977) 320, for REML in mixed linear models.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from gyrocal.effects.base import Role
from gyrocal.inference.design import Design
from gyrocal.inference.factors import inverse_factor, with_prior
from gyrocal.inference.layout import Layout
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

Index = np.ndarray[Any, np.dtype[np.signedinteger[Any]]]
Columns = Index | slice

TOLERANCE = 1e-3
"""A search for noise and spreads ends when a step gains less log-likelihood."""
LEVEL = 1e-2
"""It also ends where the log-likelihood rises by less for each unit of the coordinates."""
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

    @property
    def profile_loglik(self) -> float:
        """Log-likelihood with the shared parameters at their best: comparable between models (REML's is not)."""
        if not np.isfinite(self.loglik):  # nothing that could be solved
            return -np.inf
        logdet = float(np.linalg.slogdet(np.linalg.inv(self.cov))[1]) if self.beta.size else 0.0
        return self.loglik + 0.5 * logdet - 0.5 * self.beta.size * float(np.log(2 * np.pi))


@dataclass(frozen=True)
class Integrated:
    """Gram matrices with random coefficients integrated out, and the logarithm of the determinant of each.

    ``root`` [..., k, k] is the inverse of the Cholesky factor of the standardised coefficients' information, and ``half``
    [..., k, r] that root times the products with the other columns.
    """

    grams: Array
    logdet: Array
    root: Array
    half: Array

    @cached_property
    def weights(self) -> Array:
        """Weights [..., k, r] of ``v = weights (y, -X)``, the expectation of the standardised coefficients."""
        return np.asarray(self.root.swapaxes(-1, -2) @ self.half)

    @cached_property
    def inverse(self) -> Array:
        """Covariance [..., k, k] of v given the other coefficients."""
        return np.asarray(self.root.swapaxes(-1, -2) @ self.root)


@dataclass(frozen=True)
class Parted:
    """Parts of Gram matrices: ``inner`` [..., k, k] of the columns to integrate out, ``rest`` [..., r, r] of those that remain,
    ``cross`` [..., k, r] of both.
    """

    inner: Array
    cross: Array
    rest: Array

    @staticmethod
    def of(gram: Array, index: Columns, keep: Columns) -> Parted:
        """Part matrices [..., q, q] into the columns ``index`` and ``keep``."""
        rows = gram[..., index, :]
        return Parted(rows[..., index], rows[..., keep], gram[..., keep, :][..., keep])

    def integrate(self, sd: Array) -> Integrated:
        """Integrate out coefficients ``~ N(0, sd^2)``; ``sd`` [k], or [many, k] for many spreads at once."""
        if sd.ndim > 1:
            sd = sd[:, None]
        down, across = sd[..., None], sd[..., None, :]
        root, logdet = with_prior(np.eye(sd.shape[-1]) + down * self.inner * across)
        half = root @ (down * self.cross)
        return Integrated(self.rest - half.swapaxes(-1, -2) @ half, logdet, root, half)


def integrate(gram: Array, index: Columns, keep: Columns, sd: Array) -> Integrated:
    """Integrate out the coefficients ``~ N(0, sd^2)`` of the columns ``index``. The columns ``keep`` remain."""
    return Parted.of(gram, index, keep).integrate(sd)


@dataclass(frozen=True)
class _Shared:
    """Shared coefficients ``beta`` [..., p], their covariance, chi-square and the log-determinant of their information."""

    beta: Array
    cov: Array
    chi2: Array
    logdet: Array

    @staticmethod
    def of(total: Array) -> _Shared:
        """The solution of normal equations [..., 1 + p, 1 + p]. Of those that do not determine it, chi-square is infinite."""
        h, g = total[..., 1:, 1:], total[..., 1:, 0]
        scale: Array = np.sqrt(np.maximum(np.diagonal(h, axis1=-2, axis2=-1), 1e-300))
        scales: Array = scale[..., :, None] * scale[..., None, :]
        try:
            root, logdet = inverse_factor(h / scales)
        except np.linalg.LinAlgError:
            if total.ndim > 2:  # one of many
                each = [_Shared.of(one) for one in total]
                return _Shared(*(np.stack([getattr(one, f.name) for one in each]) for f in fields(_Shared)))
            return _Shared(np.full(g.shape, np.nan), np.full(h.shape, np.nan), np.array(np.inf), np.array(np.inf))
        root = root / scale[..., None, :]
        half, turned = root @ g[..., None], root.swapaxes(-1, -2)
        chi2 = total[..., 0, 0] - (half**2).sum(axis=(-1, -2))
        return _Shared((turned @ half)[..., 0], turned @ root, chi2, logdet + 2 * np.log(scale).sum(axis=-1))


@dataclass(frozen=True)
class _Solved:
    """Solutions as arrays, with what was integrated out. ``grams`` has one matrix for each power cycle, or for each run if no
    coefficient varies over power cycles.
    """

    loglik: Array
    beta: Array
    cov: Array
    chi2: Array
    grams: Array
    of_runs: Integrated | None
    of_scenarios: Integrated | None

    @property
    def solution(self) -> Solution:
        return Solution(float(self.loglik), self.beta, self.cov, float(self.chi2))


class Equations:
    """The normal equations of ``n`` blocks in all, prepared for solving them at one set of spreads after another.

    ``grams`` [runs, q, q] and ``logdet`` [runs] are those of each run, ``scenarios`` [runs] their power cycles. With one axis
    more in front, ``grams`` and ``logdet`` are those of many noises, which are solved at once.
    """

    def __init__(self, layout: Layout, grams: Array, logdet: Array, scenarios: Index, n: int) -> None:
        self.layout, self.grams, self.n = layout, grams, n
        self._logdet = logdet.sum(axis=-1)
        self._size = 1 + len(layout.fixed)
        self._group, self._random = np.array(layout.run_group, dtype=np.intp), np.array(layout.scenario, dtype=np.intp)
        self._members = (np.array(sorted(set(scenarios.tolist())))[:, None] == scenarios).astype(float)
        self._of_runs = Parted.of(grams, slice(self._size, None), slice(self._size)) if layout.run else None
        self._of_scenarios = None if layout.run else self._of_each_scenario(grams)

    def _of_each_scenario(self, grams: Array) -> Parted | None:
        """The parts of each power cycle's sum over its runs; None if no coefficient varies over power cycles."""
        if not self.layout.scenario:
            return None
        summed = self._members @ grams.reshape(*grams.shape[:-2], -1)
        return Parted.of(summed.reshape(*summed.shape[:-1], self._size, self._size), self._random + 1, slice(self._size))

    def solve(self, spreads: Spreads) -> Solution:
        """Integrate out the random coefficients and solve for the shared ones."""
        return self._solved(spreads).solution

    def solve_each(self, run: Array, scenarios: Array) -> list[Solution]:
        """The solution for each of many spreads over power cycles [many, k], with those over runs the same."""
        found = self._solved(Spreads(run, scenarios))
        each = zip(found.loglik, found.beta, found.cov, found.chi2, strict=True)
        return [Solution(float(loglik), beta, cov, float(chi2)) for loglik, beta, cov, chi2 in each]

    def profile_logliks(self, spreads: Spreads) -> Array:
        """:attr:`Solution.profile_loglik` at each of many noises, [many]."""
        found, p = self._solved(spreads), self._size - 1
        out, solved = np.full(found.loglik.shape, -np.inf), np.isfinite(found.loglik)
        logdet = np.linalg.slogdet(found.cov[solved])[1] if p else 0.0
        out[solved] = found.loglik[solved] - 0.5 * logdet - 0.5 * p * np.log(2 * np.pi)
        return out

    def logliks(self, spreads: Spreads) -> Array:
        """The log-likelihood [many] of each of many noises, or of many spreads [many, k] at one noise."""
        return self._solved(spreads).loglik

    def _solved(self, spreads: Spreads) -> _Solved:
        grams, logdet, p = self.grams, self._logdet, self._size - 1
        of_runs = of_scenarios = None
        parted = self._of_scenarios
        if self._of_runs is not None:
            of_runs = self._of_runs.integrate(spreads.run[..., self._group])
            grams, logdet = of_runs.grams, logdet + of_runs.logdet.sum(axis=-1)
            parted = self._of_each_scenario(grams)
        if parted is not None:
            of_scenarios = parted.integrate(spreads.scenario)
            grams, logdet = of_scenarios.grams, logdet + of_scenarios.logdet.sum(axis=-1)
        shared = _Shared.of(grams.sum(axis=-3))
        loglik = -0.5 * (logdet + shared.logdet + shared.chi2 + (self.n - p) * np.log(2 * np.pi))
        return _Solved(loglik, shared.beta, shared.cov, shared.chi2, grams, of_runs, of_scenarios)

    def solve_with_slopes(self, spreads: Spreads) -> tuple[Solution, Array]:
        """The solution, and the derivatives of its log-likelihood by the logarithm of each spread, those of runs first.

        By Fisher's identity the derivative is the sum of E[v^2 | y] - 1 over the coefficients that share a spread, where v is
        the coefficient divided by its spread.
        """
        p, solved = self._size - 1, self._solved(spreads)
        slope_run, slope_scenario = np.zeros(spreads.run.size), np.zeros(spreads.scenario.size)
        if not np.isfinite(solved.loglik):
            return solved.solution, np.concatenate([slope_run, slope_scenario])
        beta, cov = solved.beta, solved.cov
        center, spread = beta[None], cov[None]
        of_scenarios, cycles = solved.of_scenarios, solved.grams.shape[0]
        if of_scenarios is not None:
            slope_scenario = _slopes(of_scenarios, center, spread).sum(axis=0)
        if of_scenarios is not None and solved.of_runs is not None:
            pull = np.zeros((cycles, p, 1 + p))  # the coefficients of a power cycle: beta plus their random part
            pull[:, self._random] = spreads.scenario[:, None] * of_scenarios.weights
            own = np.eye(p) - pull[:, :, 1:]
            random = np.zeros((cycles, p, p))
            inverse = spreads.scenario[:, None] * of_scenarios.inverse * spreads.scenario
            random[:, self._random[:, None], self._random] = inverse
            which = self._members.argmax(axis=0)
            center = (own @ beta + pull[:, :, 0])[which]
            spread = (own @ cov @ own.swapaxes(-1, -2) + random)[which]
        if solved.of_runs is not None:
            np.add.at(slope_run, self._group, _slopes(solved.of_runs, center, spread).sum(axis=0))
        return solved.solution, np.concatenate([slope_run, slope_scenario])


def solve(layout: Layout, grams: Array, logdet: Array, scenarios: Index, n: int, spreads: Spreads) -> Solution:
    """Integrate out the random coefficients of ``grams`` [runs, p, p], and solve for the shared ones (:class:`Equations`)."""
    return Equations(layout, grams, logdet, scenarios, n).solve(spreads)


def _slopes(of: Integrated, center: Array, spread: Array) -> Array:
    """E[v^2 | y] - 1 for the coefficients that were integrated out, shape [grams, k]."""
    weights = of.weights
    b = weights[..., 1:]
    v = weights[..., 0] - (b @ center[..., None])[..., 0]
    variance = np.diagonal(of.inverse, axis1=-2, axis2=-1) + ((b @ spread) * b).sum(axis=-1)
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
        """The scale and the bounds of the spreads of one axis's design."""
        layout = design.layout
        information = np.zeros(layout.n_groups + len(layout.scenario))
        diagonal = np.diagonal(grams, axis1=-2, axis2=-1)
        per_run = diagonal[:, 1 + len(layout.fixed) :].mean(axis=0)
        information[: layout.n_groups] = _group_means(layout, per_run)
        information[layout.n_groups :] = diagonal[:, np.array(layout.scenario, dtype=np.intp) + 1].sum(axis=0) / design.cycles
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
        """Spreads [k] from coordinates [k]."""
        return self.unit * np.sqrt(np.expm1(x))

    def slopes(self, x: Array, of_log_sd: Array) -> Array:
        """Derivatives [k] by the coordinates, from derivatives by the logarithm of each spread [k]."""
        return of_log_sd / (-2 * np.expm1(-x))

    def settled(self, x: Array) -> Array:
        """Spreads [k] at the end of a search. A vanishing spread is set to zero."""
        return np.where(x > 10 * NO_SPREAD, self.spreads(x), 0.0)

    @property
    def bounds(self) -> list[tuple[float, float]]:
        """Lower and upper bound of each coordinate."""
        return [(NO_SPREAD, max(float(h), NO_SPREAD)) for h in self.high]


def maximise(loglik: Callable[[Array], tuple[float, Array]], x0: Array, bounds: list[tuple[float, float]]) -> Array:
    """The coordinates of the maximum of a log-likelihood, which is given with its derivatives.

    L-BFGS-B goes the whole gradient in its first step if every coordinate is bounded. The gradient of a log-likelihood grows
    with the data, so that step would end in a corner of the bounds. The cost is therefore scaled to a gradient of
    ``FIRST_STEP``.
    """
    from scipy.optimize import fmin_l_bfgs_b

    first = loglik(x0)
    value, slope = first
    scale = FIRST_STEP / max(float(np.linalg.norm(slope)), FIRST_STEP) if np.isfinite(value) else 1.0
    ahead = np.clip(x0 + scale * slope, *np.transpose(bounds))
    if np.isfinite(value) and np.abs(ahead - x0).max() <= LEVEL * scale:  # the search would end as it begins
        return x0

    def cost(x: Array) -> tuple[float, Array]:
        value, slope = first if np.array_equal(x, x0) else loglik(x)  # the search looks at its start again
        return (-scale * value, -scale * slope) if np.isfinite(value) else (1e300, np.zeros_like(x))

    enough = TOLERANCE * scale / max(scale * abs(value), 1.0) if np.isfinite(value) else TOLERANCE
    factor = enough / np.finfo(np.float64).eps
    return np.asarray(fmin_l_bfgs_b(cost, x0, bounds=bounds, factr=factor, pgtol=LEVEL * scale, maxiter=60)[0])


def fit_spreads(design: Design, equations: Equations, start: Spreads) -> Spreads:
    """Estimate only the spreads by REML. Spreads of ``start`` that are NaN are not known yet."""
    k = start.run.size
    if k + start.scenario.size == 0:
        return start
    scale = SpreadScale.of(design, equations.grams)

    def loglik(x: Array) -> tuple[float, Array]:
        sd = scale.spreads(x)
        solution, slopes = equations.solve_with_slopes(Spreads(sd[:k], sd[k:]))
        return solution.loglik, scale.slopes(x, slopes)

    x = maximise(loglik, scale.coordinates(np.concatenate([start.run, start.scenario])), scale.bounds)
    sd = scale.settled(x)
    return Spreads(sd[:k], sd[k:])


def _random_rms(design: Design) -> tuple[Array, Array]:
    rms, layout = design.column_rms, design.layout
    return _group_means(layout, rms[1 + len(layout.fixed) :]), rms[np.array(layout.scenario, dtype=np.intp) + 1]


def _group_means(layout: Layout, of_runs: Array) -> Array:
    """The mean of each group of columns of each run, from a value for each of these columns."""
    group = np.array(layout.run_group, dtype=np.intp)
    return np.bincount(group, of_runs, layout.n_groups) / np.bincount(group, minlength=layout.n_groups)


def unknown_spreads(design: Design) -> Spreads:
    """Spreads that are all NaN, which means not known yet."""
    layout = design.layout
    return Spreads(np.full(layout.n_groups, np.nan), np.full(len(layout.scenario), np.nan))


def _largest_dps(design: Design) -> float:
    """Upper limits of the spreads: ten times the standard deviation of the readings."""
    return 10 * float(design.column_rms[0]) + 1e-3
