"""The maximum of a log-likelihood within bounds: quasi-Newton steps towards it, then Newton's own until none is left.

A search that ends where a step gains little ends anywhere in a flat top, so that its answer depends on the rounding of the
processor and on the order of the runs. The last steps are therefore Newton's, with the second derivatives as differences of the
first, and the search ends when a step is short beside the errors with which the likelihood determines the coordinates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gyrocal.inference.design import Mask
from gyrocal.recording.session import Array

LogLikelihood = Callable[[Array], tuple[float, Array]]
"""The value at coordinates [k], and its derivatives [k]."""

NEAR = 0.1
"""The quasi-Newton search ends when a step gains less log-likelihood; Newton's method goes on from there."""
FIRST_STEP = 0.5
"""Length of the first step of a search in its coordinates, which are logarithms of ratios."""
REACH, LEAST_REACH = 1.0, 1e-7
"""First half-width of the box about the coordinates in which the second derivatives are trusted, and the least one."""
SETTLED = 1e-3
"""The search ends at a step shorter than this part of the coordinates' errors."""
STEPS = 60
DIFFERENCE = 3e-5
"""Of the coordinates, over which first derivatives are compared for the second."""
FLAT = 1e-4
"""Information below which a coordinate counts as not determined: its error of 100 exceeds the bounds of any."""
NEWTON_ONLY, SLOW = 0.3, 0.1
"""Second derivatives are computed again while steps are longer than this, in errors, or than this part of the one before."""
ROUNDING = 1e-12
"""Of the log-likelihood, by which a step may seem to lose."""


def maximise(loglik: LogLikelihood, x0: Array, bounds: list[tuple[float, float]]) -> Array:
    """The coordinates of the maximum of a log-likelihood, which is given with its derivatives.

    L-BFGS-B goes the whole gradient in its first step if every coordinate is bounded. The gradient of a log-likelihood grows
    with the data, so that step would end in a corner of the bounds. The cost is therefore scaled to a gradient of
    ``FIRST_STEP``.
    """
    from scipy.optimize import minimize

    first = loglik(x0)
    value, slope = first
    if not np.isfinite(value):
        return x0
    scale = FIRST_STEP / max(float(np.linalg.norm(slope)), FIRST_STEP)

    def cost(x: Array) -> tuple[float, Array]:
        value, slope = first if np.array_equal(x, x0) else loglik(x)  # the search looks at its start again
        return (-scale * value, -scale * slope) if np.isfinite(value) else (1e300, np.zeros_like(x))

    enough = NEAR * scale / max(scale * abs(value), 1.0)
    found = minimize(cost, x0, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 60, "ftol": enough})
    return _Ascent(loglik, *np.transpose(bounds)).from_(np.asarray(found.x))


def _promised(step: Array, slope: Array, information: Array) -> float:
    """The log-likelihood that a step [k] gains if the second derivatives describe it."""
    return float(slope @ step - step @ information @ step / 2)


@dataclass(frozen=True)
class _Ascent:
    """Newton's method between bounds ``low`` and ``high`` [k], in a box whose size follows how well it predicts the gain."""

    loglik: LogLikelihood
    low: Array
    high: Array

    def from_(self, x: Array) -> Array:
        """The maximum that Newton's steps from ``x`` [k] lead to."""
        value, slope = self.loglik(x)
        free, information, known = np.zeros(x.size, dtype=bool), np.eye(x.size), False
        reach, before = REACH, np.inf
        for _ in range(STEPS):
            now = self._free(x, slope)
            fresh = not known or bool((now & ~free).any())
            if fresh:
                free, information, known = now, self._information(x, slope, now), True
            step = self._step(x, slope, information, now, np.inf)
            length = float(np.sqrt(max(0.0, 2 * _promised(step, slope, information))))  # in errors
            if length < SETTLED:
                break
            if np.abs(step).max() > reach:
                step = self._step(x, slope, information, now, reach)
            width, promised = float(np.abs(step).max()), _promised(step, slope, information)
            trial = np.clip(x + step, self.low, self.high)
            there, slope_there = self.loglik(trial)
            gain = there - value if np.isfinite(there) else -np.inf
            if gain < promised / 4:
                reach = width / 4
            elif gain > 0.75 * promised and width > 0.99 * reach:
                reach *= 2
            if gain < -ROUNDING * abs(value):
                if fresh and reach < LEAST_REACH:
                    break
                known = fresh
                continue
            known = length < NEWTON_ONLY and (fresh or length < SLOW * before)
            x, value, slope, before = trial, there, slope_there, length
        return x

    def _free(self, x: Array, slope: Array) -> Mask:
        """False [k] for coordinates at a bound beyond which the likelihood would rise."""
        return np.asarray(((x > self.low) | (slope > 0)) & ((x < self.high) | (slope < 0)))

    def _information(self, x: Array, slope: Array, free: Mask) -> Array:
        """The negative second derivatives [k, k] of the free coordinates, zero for the others, made positive definite."""
        out = np.zeros((x.size, x.size))
        for j in np.flatnonzero(free)[::-1]:
            h = DIFFERENCE if x[j] + DIFFERENCE <= self.high[j] else -DIFFERENCE
            moved = x.copy()
            moved[j] += h
            out[j] = (slope - self.loglik(moved)[1]) / h
        out[:, np.flatnonzero(np.logical_not(free))] = 0.0
        values, vectors = np.linalg.eigh((out + out.T) / 2)
        return np.asarray((vectors * np.maximum(np.abs(values), FLAT)) @ vectors.T)

    def _step(self, x: Array, slope: Array, information: Array, free: Mask, reach: float) -> Array:
        """The step [k] of the free coordinates within bounds and ``reach`` that gains most by the second derivatives."""
        from scipy.optimize import lsq_linear

        step, index = np.zeros(x.size), np.flatnonzero(free)
        low, high = np.maximum(self.low - x, -reach)[index], np.minimum(self.high - x, reach)[index]
        matrix = information[np.ix_(index, index)]
        step[index] = np.linalg.solve(matrix, slope[index])
        if ((step[index] < low) | (step[index] > high)).any():
            root = np.linalg.cholesky(matrix)
            step[index] = lsq_linear(root.T, np.linalg.solve(root, slope[index]), (low, high), method="bvls").x
        return step
