"""Uncertainty of a spread over few power cycles, as a factor on the standard errors of the quantities that depend on it.

A standard error at the fitted spreads takes them for known. With c power cycles, the estimate is then distributed like
Student's t with about c - 1 degrees of freedom, and a spread that is fitted as zero has no part in the error at all. The
spreads are therefore averaged over. Each value weighs as much as its likelihood (REML) and its prior probability. The prior
holds that the quantity does not vary at all with the probability ``POLICY.same_in_cycles``, and is otherwise uniform in
``log(1 + sd / unit)``, where ``unit`` is the error with which one power cycle determines its own offset: flat for spreads that
no cycle shows and scale-free above (Gelman, Bayesian Analysis 1 (2006) 515, discusses such priors). The factor makes the
interval of 1.96 standard errors hold 95 % of that mixture of normal distributions.
"""

from __future__ import annotations

import numpy as np

from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.reml import LARGEST_SPREAD, SpreadScale
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array
from gyrocal.tails import Z95

POINTS = 25
"""Spreads, evenly in the prior's coordinate, over which the average goes."""
PHYSICAL, BEYOND = 0.1, 10.0
"""The prior ends at this fraction of the largest spread, ten times the typical, or at this multiple of the fitted one."""
HALVINGS = 40


def widening(current: AxisFit) -> Array:
    """The factor [p] on the standard error of each shared coefficient, for its most influential spread; 1 if nothing varies."""
    p, k = current.solution.beta.size, current.spreads.run.size
    out = np.ones(p)
    design = current.design
    if not current.spreads.scenario.size or design.cycles < 2 or not np.isfinite(current.loglik):
        return out
    scale = SpreadScale.of(design, current.grams)
    roles = [design.terms[design.layout.fixed[j][0]].effect.role for j in design.layout.scenario]
    limits = PHYSICAL * np.array([LARGEST_SPREAD[role] for role in roles])
    largest = np.minimum(scale.spreads(scale.high)[k:], np.maximum(limits, BEYOND * current.spreads.scenario))
    equations = current.equations()
    for j in range(current.spreads.scenario.size):
        unit = float(scale.unit[k + j])
        if unit <= 0:
            continue
        scenario = np.tile(current.spreads.scenario, (POINTS, 1))
        scenario[:, j] = unit * np.expm1(np.linspace(0.0, np.log1p(largest[j] / unit), POINTS))
        tried = equations.solve_each(current.spreads.run, scenario)
        loglik = np.array([s.loglik for s in tried])
        weight = np.exp(loglik - loglik.max()) * (1 - POLICY.same_in_cycles)
        weight[0] += np.exp(loglik[0] - loglik.max()) * POINTS * POLICY.same_in_cycles
        sd = np.sqrt(np.array([np.diag(s.cov) for s in tried]))
        off = np.array([s.beta for s in tried]) - current.solution.beta
        half = _half_of_95(weight / weight.sum(), off, sd)
        out = np.maximum(out, half / (Z95 * np.sqrt(np.diag(current.solution.cov))))
    return out


def _half_of_95(weight: Array, off: Array, sd: Array) -> Array:
    """Half [p] of the interval about zero that holds 95 % of normal distributions of mean ``off`` and ``sd`` [points, p]."""
    from scipy.special import ndtr

    low, high = np.zeros(sd.shape[1]), np.max(np.abs(off) + 6 * sd, axis=0)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        inside = weight @ (ndtr((middle - off) / sd) - ndtr((-middle - off) / sd))
        low, high = np.where(inside < 0.95, middle, low), np.where(inside < 0.95, high, middle)
    return np.asarray(high)
