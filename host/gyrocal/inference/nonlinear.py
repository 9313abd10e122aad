"""The nonlinear parameters of an axis's terms, refined about the values that the choice of the structure found."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.likelihood_ratio import profile_loglik
from gyrocal.inference.noise_search import fit_noise, with_noise
from gyrocal.recording.session import Array


def refine(current: AxisFit) -> AxisFit:
    """Nonlinear parameters at fixed noise, one term at a time, then the noise again.

    They maximise the profile likelihood. REML's would depend on the units of the columns, which change with a time constant.
    """
    from scipy.optimize import minimize

    moved = False
    for i, term in enumerate(current.design.terms):
        names = [n for n in term.effect.nonlinear if n in term.values]
        if not names or term.of_run:
            continue
        base = current
        bounds = [np.log(term.effect.parameter(name).search_range) for name in names]
        x0 = np.array([np.clip(np.log(term.values[n]), *b) for n, b in zip(names, bounds, strict=True)])

        def at(x: Array, i: int = i, names: list[str] = names, base: AxisFit = base) -> AxisFit:
            values = dict(zip(names, map(float, np.exp(x)), strict=True))
            return with_noise(base.design.with_values(i, values), base.noise, base.spreads)

        runs = [b.run for b in current.design.blocks]
        steps = [term.effect.step(name, term.values, runs) for name in names]
        simplex = np.vstack([x0, *(x0 + np.diag(steps))])

        def cost(x: Array, at: Callable[[Array], AxisFit] = at) -> float:
            return -profile_loglik(at(x))

        found = minimize(
            cost, x0, method="Nelder-Mead", bounds=bounds,
            options={"xatol": 3e-3 * min(steps), "fatol": 1e-3, "maxfev": 40 * len(names), "initial_simplex": simplex},
        )  # fmt: skip
        better = at(found.x)
        if profile_loglik(better) > profile_loglik(current):
            current, moved = better, True
    return fit_noise(current.design, start=current) if moved else current
