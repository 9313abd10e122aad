"""What the drift leaves unknown of the spreads over power cycles: a factor on their standard errors.

In a run that is not much longer than the drift's correlation time, a drift moves the mean of the run as the offset of a power
cycle does. With the spread's logarithm s and the search coordinates n of the drift (logarithms of its growth and its rate), the
inverse of the joint information has ``1 / (J_ss - J_sn J_nn^-1 J_ns)`` for s, where the error at the fitted drift is
``1 / J_ss``. The white level is left out: it is known far better than the others.
"""

from __future__ import annotations

import numpy as np

from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.noise_search import NoiseScale
from gyrocal.inference.reml import Equations
from gyrocal.recording.session import Array

STEP = 0.2
"""Of the logarithms of growth and rate: about half of their errors."""
PRIOR = 1 / 9
"""Information of their prior: growth and rate are known to a factor of 20 beforehand (one standard deviation)."""
LEAST = 0.04
"""Of the information of a spread: what the drift leaves at the least. Less is not resolved by differences."""


def drift_factor(current: AxisFit, scenario_se: Array) -> Array:
    """The factor [k] on the errors [k] of the spreads over power cycles; 1 where no drift was searched for, or no spread."""
    sd, out = current.spreads.scenario, np.ones(current.spreads.scenario.size)
    drift = current.design.noise_model.drift
    if drift is None or drift.known or current.noise.ou_sd_dps <= 0 or not (sd > 0).any():
        return out
    scale = NoiseScale.of(current.design)
    if not scale.drift:
        return out
    x = scale.coordinates(current.noise)
    steps = np.diag([0.0, min(STEP, x[1] / 2), STEP])[1:]

    def at(step: Array) -> tuple[float, Array]:
        """Log-likelihood, and its derivatives [k] by the logarithms of the spreads."""
        design = current.design
        grams, logdet = design.grams(scale.noise(np.clip(x + step, *np.transpose(scale.bounds))))
        n = int(design.n_blocks.sum())
        equations = Equations(design.layout, grams, logdet, design.scenarios, n)
        solution, slopes = equations.solve_with_slopes(current.spreads)
        return solution.loglik, slopes[current.spreads.run.size :]

    here, size = current.loglik, steps.max(axis=1)
    ends = [(at(-step), at(step)) for step in steps]
    both = sum(at(sign * steps.sum(axis=0))[0] for sign in (-1.0, 1.0))
    if not np.isfinite([here, both, *(loglik for pair in ends for loglik, _ in pair)]).all():
        return out
    own = [(2 * here - below[0] - above[0]) / h**2 for (below, above), h in zip(ends, size, strict=True)]
    cross = (2 * here - both - own[0] * size[0] ** 2 - own[1] * size[1] ** 2) / (2 * size[0] * size[1])
    information = np.array([[own[0], cross], [cross, own[1]]])
    shared = np.array([(below[1] - above[1]) / (2 * h) for (below, above), h in zip(ends, size, strict=True)])  # [2, k]
    values, vectors = np.linalg.eigh(information)
    along = vectors.T @ shared
    taken = (along**2 / (np.maximum(values, 0.0) + PRIOR)[:, None]).sum(axis=0)
    known = sd > 0
    out[known] = 1 / np.sqrt(np.maximum(1 - taken[known] * (scenario_se[known] / sd[known]) ** 2, LEAST))
    return out
