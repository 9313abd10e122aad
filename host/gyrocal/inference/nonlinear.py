"""The nonlinear parameters of an axis's terms, refined about the values that the choice of the structure found."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.noise_search import carried, fit_noise
from gyrocal.recording.session import Array

NEARBY, MOVES = 3.0, 5
"""A single parameter is searched within so many of its steps, and again about what was found if that is at the edge."""
EXACT = 3e-3
"""Fraction of a step to which a parameter is determined."""
GRID, GRIDS = 13, 4
"""Points of a grid over a likelihood with steps, and number of grids, each over three spacings of the one before."""
UNSOLVED = 1e50
"""The cost of values at which nothing can be solved. A search that interpolates takes no infinite one."""

Cost = Callable[[Array], float]


def refine(current: AxisFit) -> AxisFit:
    """Nonlinear parameters at fixed noise, one term at a time, then the noise again.

    They maximise the profile likelihood. REML's would depend on the units of the columns, which change with a time constant.
    """
    moved = False
    for i, term in enumerate(current.design.terms):
        names = [n for n in term.effect.nonlinear if n in term.values and n not in term.held]
        if not names or term.of_run:
            continue
        base = current
        bounds = np.array([np.log(term.effect.parameter(name).search_range) for name in names])
        x0 = np.clip(np.log([term.values[n] for n in names]), *bounds.T)

        def at(x: Array, i: int = i, names: list[str] = names, base: AxisFit = base) -> AxisFit:
            values = dict(zip(names, map(float, np.exp(x)), strict=True))
            design = base.design.with_values(i, values)
            return carried(base, design)

        def cost(x: Array, at: Callable[[Array], AxisFit] = at) -> float:
            return min(-at(x).solution.profile_loglik, UNSOLVED)

        runs = [b.run for b in current.design.blocks]
        fineness = [term.effect.refinement(name, term.values, runs, current.design.axis) for name in names]
        steps = np.array([of.step for of in fineness])
        stairs = len(names) == 1 and fineness[0].resolution > 0
        search = _stairs if stairs else _one if len(names) == 1 else _several
        better = at(search(cost, x0, bounds, steps))
        if better.solution.profile_loglik > current.solution.profile_loglik:
            current, moved = better, True
    return fit_noise(current.design, start=current) if moved else current


def _one(cost: Cost, x0: Array, bounds: Array, steps: Array) -> Array:
    """The minimum of one parameter, by Brent's method in a window that follows it."""
    from scipy.optimize import minimize_scalar

    (low, high), (step,), x = bounds[0], steps, float(x0[0])
    for _ in range(MOVES):
        window = max(low, x - NEARBY * step), min(high, x + NEARBY * step)
        found = minimize_scalar(lambda v: cost(np.array([v])), bounds=window, method="bounded", options={"xatol": EXACT * step})
        x = float(found.x)
        inner = min(x - window[0], window[1] - x) > 0.05 * step
        if inner or window == (low, high) or min(x - low, high - x) < 0.05 * step:
            break
    ends = [np.array([v]) for v in (low, high) if abs(x - v) < 0.05 * step]  # Brent's method never tries an end itself
    return min([np.array([x]), *ends], key=cost)


def _stairs(cost: Cost, x0: Array, bounds: Array, steps: Array) -> Array:
    """The minimum of one parameter between whose values the cost has steps: the middle of the lowest, by ever finer grids."""
    (low, high), half, x = bounds[0], NEARBY * float(steps[0]), float(x0[0])
    for _ in range(GRIDS):
        grid = np.clip(np.linspace(x - half, x + half, GRID), low, high)
        costs = np.array([cost(np.array([v])) for v in grid])
        x, half = float(grid[costs == costs.min()].mean()), 3 * half / (GRID - 1)
    return np.array([x])


def _several(cost: Cost, x0: Array, bounds: Array, steps: Array) -> Array:
    """The minimum of several parameters."""
    from scipy.optimize import minimize

    found = minimize(
        cost, x0, method="Nelder-Mead", bounds=bounds.tolist(),
        options={
            "xatol": EXACT * float(steps.min()), "fatol": 1e-3, "maxfev": 40 * x0.size,
            "initial_simplex": np.vstack([x0, *(x0 + np.diag(steps))]),
        },
    )  # fmt: skip
    return np.asarray(found.x)
