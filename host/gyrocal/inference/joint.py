"""The joint error of an axis's shared coefficients and nonlinear parameters.

A coefficient and the time constant that shapes its column are estimated together, so that each one's error depends on the
other's. Let ``beta(eta)`` be the coefficients fitted at given nonlinear parameters ``eta`` (in logarithms), ``C`` their
covariance at the fitted ``eta``, ``D`` the derivative of ``beta(eta)`` and ``K`` the curvature of the profile log-likelihood of
``eta``. The inverse of the joint information matrix is

    [ C + D K^-1 D'   D K^-1 ]
    [     K^-1 D'      K^-1  ]

Where the profile is not close to a parabola (at a bound, or nearly flat), errors are those of the profile likelihood. Where the
data hardly show the term at all, it may be absent, and any value of its nonlinear parameter is possible, because the maximum is
one of noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.noise_search import with_noise
from gyrocal.inference.reml import unknown_spreads
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

FALL = 0.5
"""Fall of the log-likelihood at the ends of an interval of one standard error."""
LOPSIDED = 0.1
"""Largest difference of the falls on either side, over their sum, of a profile that counts as a parabola."""
BISECTIONS, WITHIN = 6, 3
"""Bisections for an end of a profile's interval, and points between the maximum and that end."""

Function = Callable[[Array, Array], Array]
"""Quantities [m] from shared coefficients [p] and logarithms [k] of nonlinear parameters."""


@dataclass(frozen=True)
class Point:
    """A fit at given logarithms [k] of the nonlinear parameters: how far the profile log-likelihood is below its maximum."""

    log_values: Array
    fall: float
    beta: Array
    cov: Array

    def interval(self, of: Function) -> tuple[Array, Array]:
        """Ends [m] of the quantities' profile intervals at these nonlinear parameters."""
        value, slopes = _slopes(lambda beta: of(beta, self.log_values), self.beta, _sd(self.cov))
        half = np.sqrt(np.maximum(0.0, 1 - self.fall / FALL)) * _propagated(slopes, self.cov)
        return value - half, value + half


@dataclass(frozen=True)
class Joint:
    """What an axis's runs share. ``nonlinear`` holds pairs of term index and name.

    ``cov`` [p + k, p + k] is the covariance of the coefficients and of the logarithms of the nonlinear parameters; None if the
    likelihood is no parabola. Its ``profile`` is then used, the points of which lie within ``FALL`` of the maximum.
    """

    nonlinear: tuple[tuple[int, str], ...]
    at: Point
    cov: Array | None
    profile: tuple[Point, ...] = ()
    one_sided: bool = False
    """True if a nonlinear parameter is at the end of its range of search, or is not determined."""

    def errors(self, of: Function) -> Array:
        """Standard errors [m] of quantities; from a profile, half of the interval, or the distance of the farther end."""
        if self.cov is not None:
            x, p = np.concatenate([self.at.beta, self.at.log_values]), self.at.beta.size
            _, slopes = _slopes(lambda x: of(x[:p], x[p:]), x, _sd(self.cov))
            return _propagated(slopes, self.cov)
        ends = [p.interval(of) for p in self.profile]
        lower, upper = np.min([low for low, _ in ends], axis=0), np.max([high for _, high in ends], axis=0)
        value = of(self.at.beta, self.at.log_values)
        return np.maximum(upper - value, value - lower) if self.one_sided else np.asarray(upper - lower) / 2


    def widened(self, factor: Array, of_nonlinear: Array) -> Joint:
        """The same with the errors of the coefficients times ``factor`` [p], and of nonlinear parameters times theirs [k]."""

        def of(point: Point) -> Point:
            return replace(point, cov=np.outer(factor, factor) * point.cov)

        both = np.concatenate([factor, of_nonlinear])
        cov = None if self.cov is None else np.outer(both, both) * self.cov
        return replace(self, at=of(self.at), cov=cov, profile=tuple(of(point) for point in self.profile))


def _sd(cov: Array) -> Array:
    return np.asarray(np.sqrt(np.maximum(np.diag(cov), 0.0)))


def _slopes(of: Callable[[Array], Array], x: Array, sd: Array) -> tuple[Array, Array]:
    """Quantities [m] at x [n], and their derivatives [m, n] over steps of a thousandth of a standard error."""
    value = of(x)
    slopes = np.zeros((value.size, x.size))
    for j in np.flatnonzero(sd > 0):
        moved = x.copy()
        moved[j] += 1e-3 * sd[j]
        if moved[j] != x[j]:  # an error below rounding
            slopes[:, j] = (of(moved) - value) / (moved[j] - x[j])
    return value, slopes


def errors_of(of: Callable[[Array], Array], x: Array, cov: Array) -> Array:
    """Standard errors [m] of quantities of x [n], whose covariance is ``cov`` [n, n]."""
    return _propagated(_slopes(of, x, _sd(cov))[1], cov)


def _propagated(slopes: Array, cov: Array) -> Array:
    return np.asarray(np.sqrt(np.maximum(np.einsum("ik,kl,il->i", slopes, cov, slopes), 0.0)))


class _Likelihood:
    """The profile log-likelihood about a fit, over shifts [k] of the logarithms of its nonlinear parameters."""

    def __init__(self, current: AxisFit, nonlinear: tuple[tuple[int, str], ...]) -> None:
        self.current, self.nonlinear = current, nonlinear
        terms = current.design.terms
        self.log_values = np.log([terms[i].values[name] for i, name in nonlinear])
        ranges = [np.log(terms[i].effect.parameter(name).search_range) for i, name in nonlinear]
        self.low, self.high = (np.array([r[k] for r in ranges]) - self.log_values for k in (0, 1))
        self.top = current.solution.profile_loglik
        self.known: dict[bytes, Point] = {}

    def __call__(self, shift: Array) -> Point:
        key = shift.tobytes()
        if key not in self.known:
            self.known[key] = self._point(shift)
        return self.known[key]

    def _point(self, shift: Array) -> Point:
        if not shift.any():
            return Point(self.log_values, 0.0, self.current.solution.beta, self.current.solution.cov)
        design = self.current.design
        for j in np.flatnonzero(shift):
            i, name = self.nonlinear[j]
            design = design.with_values(i, {name: float(np.exp(self.log_values[j] + shift[j]))})
        same = design.layout.fixed == self.current.design.layout.fixed
        moved = with_noise(design, self.current.noise, self.current.spreads) if same else None
        if moved is None or not np.isfinite(moved.loglik):
            return Point(self.log_values + shift, np.inf, self.current.solution.beta, self.current.solution.cov)
        return Point(self.log_values + shift, self.top - moved.solution.profile_loglik, moved.solution.beta, moved.solution.cov)

    def without(self, i: int) -> Point:
        """The fit without a term, at the same noise: its coefficients are zero."""
        terms = [term for k, term in enumerate(self.current.design.terms) if k != i]
        design = self.current.design.changed(terms)
        poorer = with_noise(design, self.current.noise, unknown_spreads(design))
        absent = np.array([t == i for t, _ in self.current.design.layout.fixed])
        beta = np.where(absent, 0.0, self.current.solution.beta)
        cov = np.where(absent | absent[:, None], 0.0, self.current.solution.cov)
        if poorer.solution.beta.size == np.count_nonzero(~absent):
            beta[~absent], cov[np.ix_(~absent, ~absent)] = poorer.solution.beta, poorer.solution.cov
        return Point(self.log_values, self.top - poorer.solution.profile_loglik, beta, cov)

    def along(self, j: int, shift: float) -> Point:
        """The point at which one parameter is shifted alone."""
        return self(np.where(np.arange(self.log_values.size) == j, shift, 0.0))


def joint(current: AxisFit) -> Joint:
    """The joint error of an axis's shared coefficients and nonlinear parameters.

    A parameter that differs from run to run has its error from its spread (:mod:`gyrocal.inference.runs_apart`).
    """
    nonlinear = tuple(
        (i, name)
        for i, term in enumerate(current.design.terms) if not term.of_run
        for name in term.effect.nonlinear if name in term.values and name not in term.held
    )  # fmt: skip
    likelihood = _Likelihood(current, nonlinear)
    at = likelihood(np.zeros(len(nonlinear)))
    if not nonlinear:
        return Joint(nonlinear, at, current.solution.cov)
    for k, (i, _) in enumerate(nonlinear):
        absent = likelihood.without(i)
        if absent.fall < POLICY.determined_gain:
            return Joint(nonlinear, at, None, (at, replace(absent, fall=0.0), *_everywhere(likelihood, k)), one_sided=True)
    runs = [b.run for b in current.design.blocks]
    terms = [(current.design.terms[i], name) for i, name in nonlinear]
    first = [t.effect.refinement(name, t.values, runs, current.design.axis).step / 6 for t, name in terms]
    steps = np.array([_one_error(likelihood, j, step) for j, step in enumerate(first)])
    lopsided = np.array([_lopsided(likelihood, j, step) for j, step in enumerate(steps)])
    if (lopsided <= LOPSIDED).all():
        curvature = _curvature(likelihood, steps)
        if np.linalg.eigvalsh(curvature).min() > 0:
            return Joint(nonlinear, at, _covariance(likelihood, steps, curvature))
    worst = int(np.argmax(lopsided))
    points = (at, *_side(likelihood, worst, steps[worst], -1.0), *_side(likelihood, worst, steps[worst], 1.0))
    at_bound = min(-likelihood.low[worst], likelihood.high[worst]) < 1e-3
    return Joint(nonlinear, at, None, points, bool(at_bound))


def _one_error(likelihood: _Likelihood, j: int, step: float) -> float:
    """A step of about one standard error of a parameter's logarithm: there, a parabola has fallen by :data:`FALL`."""
    for _ in range(4):
        fall = (likelihood.along(j, step).fall + likelihood.along(j, -step).fall) / 2
        factor = float(np.sqrt(FALL / fall)) if fall > 0 else np.inf
        if 0.5 < factor < 2:
            break
        step = float(np.clip(step * np.clip(factor, 0.05, 8.0), 1e-9, 1.0))
    return step


def _lopsided(likelihood: _Likelihood, j: int, step: float) -> float:
    """Difference of the falls on either side of the maximum over their sum; infinite if the step leaves the range of search."""
    below, above = likelihood.along(j, -step).fall, likelihood.along(j, step).fall
    if step > min(-likelihood.low[j], likelihood.high[j]) or not 0 < below + above < np.inf:
        return np.inf
    return abs(above - below) / (above + below)


def _curvature(likelihood: _Likelihood, steps: Array) -> Array:
    """Negative second derivatives [k, k] of the profile log-likelihood."""
    k = steps.size
    moves = np.diag(steps)
    falls = np.array([[likelihood(sign * move).fall for sign in (-1.0, 1.0)] for move in moves]).sum(axis=1)
    out = np.diag(falls / steps**2)
    for i in range(k):
        for j in range(i):
            both = sum(likelihood(sign * (moves[i] + moves[j])).fall for sign in (-1.0, 1.0))
            out[i, j] = out[j, i] = (both - falls[i] - falls[j]) / (2 * steps[i] * steps[j])
    return out


def _covariance(likelihood: _Likelihood, steps: Array, curvature: Array) -> Array:
    """The inverse of the joint information."""
    ends = [(likelihood.along(j, -step).beta, likelihood.along(j, step).beta) for j, step in enumerate(steps)]
    slopes = np.column_stack([(above - below) / (2 * step) for (below, above), step in zip(ends, steps, strict=True)])
    of_nonlinear = np.linalg.inv(curvature)
    shared = likelihood.current.solution.cov + slopes @ of_nonlinear @ slopes.T
    return np.block([[shared, slopes @ of_nonlinear], [of_nonlinear @ slopes.T, of_nonlinear]])


def _side(likelihood: _Likelihood, j: int, step: float, sign: float) -> list[Point]:
    """Points of a parameter's profile from its maximum to where it has fallen by :data:`FALL`, or to its range's end."""
    limit = float(likelihood.high[j] if sign > 0 else -likelihood.low[j])
    if limit <= 0:
        return []
    inside, outside = 0.0, min(step, limit)
    while likelihood.along(j, sign * outside).fall < FALL:
        inside = outside
        if outside == limit:
            break
        outside = min(2 * outside, limit)
    for _ in range(BISECTIONS if inside < outside else 0):
        middle = (inside + outside) / 2
        inside, outside = (middle, outside) if likelihood.along(j, sign * middle).fall < FALL else (inside, middle)
    found = [likelihood.along(j, sign * inside * (n + 1) / WITHIN) for n in range(WITHIN)] if inside > 0 else []
    return [p for p in found if p.fall < FALL]


def _everywhere(likelihood: _Likelihood, j: int) -> list[Point]:
    """Points of a parameter over its whole range of search, each as possible as the maximum."""
    shifts = np.linspace(float(likelihood.low[j]), float(likelihood.high[j]), 2 * WITHIN + 1)
    points = [likelihood.along(j, float(shift)) for shift in shifts]
    return [replace(p, fall=0.0) for p in points if np.isfinite(p.fall)]
