"""How much better a richer model of an axis explains the session, and the chance that noise gains as much."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.noise_search import with_noise
from gyrocal.inference.reml import Spreads, SpreadScale
from gyrocal.recording.session import Array

FREE = 1e3
"""Of a spread, or what one power cycle knows of it: wide enough to say nothing."""
LEAST_CHANCE = 0.05
"""More is no finding, whatever the test."""


def likelihood_ratio(current: AxisFit, fitted: AxisFit, parameters: int) -> tuple[float, float]:
    """Twice the log-likelihood that a richer model's parameters gain, and the chance that noise gains as much.

    Both at their own noise, the poorer one also at the richer one's, whichever suits it. Chi-square takes the spread of power
    cycles for known, and a few cycles say little of it: what differs from cycle to cycle alone has to pass an F test of as many
    values as there are cycles. What shows within them has to pass chi-square with each cycle's own offset left free. The better
    of the two counts, twice, for there were two.
    """
    from scipy.stats import chi2, f

    poorer = [current]
    if fitted.noise != current.noise:
        poorer.append(with_noise(current.design, fitted.noise, current.spreads))
    statistic = max(0.0, 2 * (profile_loglik(fitted) - max(map(profile_loglik, poorer))))
    chance = float(chi2.sf(statistic, parameters))
    layout, cycles = current.design.layout, np.unique(current.design.scenarios).size
    if not layout.scenario or chance > LEAST_CHANCE:
        return statistic, chance
    known = SpreadScale.of(current.design, current.grams).unit[current.spreads.run.size :]
    free = FREE * np.maximum(current.spreads.scenario, known)
    within = 2 * (_of_free_cycles(fitted, free) - max(_of_free_cycles(one, free) for one in poorer))
    left = cycles - len(layout.fixed) - parameters
    ratio = float(np.expm1(min(statistic / cycles, 500.0))) * left / parameters
    between = float(f.sf(ratio, parameters, left)) if left > 0 else 1.0
    return statistic, max(chance, min(1.0, 2 * min(float(chi2.sf(within, parameters)), between)))


def _of_free_cycles(fitted: AxisFit, scenario_sd: Array) -> float:
    """Profile log-likelihood with the offset (and scale) of each power cycle free: what runs say by themselves."""
    free = fitted.equations().solve(Spreads(fitted.spreads.run, scenario_sd))
    return profile_loglik(replace(fitted, solution=free))


def profile_loglik(fitted: AxisFit) -> float:
    """Log-likelihood at the fitted noise, shared parameters at their best: comparable between models (REML's is not)."""
    if not np.isfinite(fitted.loglik):  # nothing that could be solved
        return -np.inf
    chol = np.linalg.slogdet(np.linalg.inv(fitted.solution.cov))[1] if fitted.solution.beta.size else 0.0
    return fitted.loglik + 0.5 * float(chol) - 0.5 * fitted.solution.beta.size * float(np.log(2 * np.pi))
