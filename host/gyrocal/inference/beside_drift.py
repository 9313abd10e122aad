"""Standard errors of the spreads over power cycles beside a drift that is not known either.

In a run that is not much longer than the drift's correlation time, a drift moves the mean of the run as the offset of a power
cycle does. A spread over few power cycles is also no normal variable: for c cycles it is distributed as the root of chi-square
with c - 1 degrees of freedom, which is nearly symmetric in its logarithm and not in itself. The restricted likelihood is
therefore averaged over drifts whose growth and rate differ from the fitted ones by a factor of two (one standard deviation),
and the spread is uniform beforehand in ``log(1 + sd / unit)`` (:mod:`gyrocal.inference.few_cycles`). The error is stated such
that ``sd * exp(-1.96 se / sd)`` to ``sd * exp(1.96 se / sd)`` holds 95 % of the result.
"""

from __future__ import annotations

import numpy as np

from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.reml import Equations, Spreads, SpreadScale
from gyrocal.noise.whitening import Noise
from gyrocal.recording.session import Array

SPREADS = 60
"""Points over the spread."""
KNOWN = float(np.log(2.0))
"""Standard deviation of the logarithms of the drift's growth and rate."""
HERMITE = {-(3**0.5): 1 / 6, 0.0: 2 / 3, 3**0.5: 1 / 6}
"""Places, in standard deviations, and weights of the average over a normal variable."""
BEYOND = 20.0
"""Largest spread that is tried, as a multiple of the fitted one."""
Z95 = 1.959964


def spread_errors_beside_drift(current: AxisFit, scenario_se: Array) -> Array:
    """The standard errors [k] of the spreads over power cycles; ``scenario_se`` where a spread vanishes."""
    out, fitted = scenario_se.copy(), current.spreads
    unit = SpreadScale.of(current.design, current.grams).unit[fitted.run.size :]
    free = np.flatnonzero((fitted.scenario > 0) & (unit > 0))
    if not free.size or np.unique(current.design.scenarios).size < 2:
        return out
    drifts = [(_equations(current, noise), weight) for noise, weight in _drifts(current)]
    for j in free.tolist():
        trial = unit[j] * np.expm1(np.linspace(0.0, np.log1p(BEYOND * fitted.scenario[j] / unit[j]), SPREADS + 1)[1:])
        scenario = np.tile(fitted.scenario, (SPREADS, 1))
        scenario[:, j] = trial
        spreads = Spreads(np.tile(fitted.run, (SPREADS, 1)), scenario)
        loglik = np.array([one.logliks(spreads) + np.log(weight) for one, weight in drifts])
        weight = np.exp(loglik - loglik.max()).sum(axis=0)
        out[j] = fitted.scenario[j] * _half_of_95(weight / weight.sum(), np.log(trial / fitted.scenario[j])) / Z95
    return out


def _drifts(current: AxisFit) -> list[tuple[Noise, float]]:
    """The noise with drifts about the fitted one, and their weights; the fitted noise alone if no drift is searched for."""
    noise, drift = current.noise, current.design.noise_model.drift
    if drift is None or drift.known is not None or noise.ou_sd_dps <= 0:
        return [(noise, 1.0)]

    def beside(growth: float, rate: float) -> Noise:
        """The noise with a drift whose growth ``sd^2 / tau`` and rate ``1 / tau`` are other ones, by logarithms of ratios."""
        sd_dps, tau_s = noise.ou_sd_dps * float(np.exp((growth - rate) / 2)), noise.ou_tau_s * float(np.exp(-rate))
        return Noise(noise.white_sd_dps, sd_dps, tau_s)

    places = [(KNOWN * place, weight) for place, weight in HERMITE.items()]
    return [(beside(growth, rate), of_growth * of_rate) for growth, of_growth in places for rate, of_rate in places]


def _equations(current: AxisFit, noise: Noise) -> Equations:
    design = current.design
    grams, logdet = design.grams(noise)
    return Equations(design.layout, grams, logdet, design.scenarios, int(design.n_blocks.sum()))


def _half_of_95(weight: Array, log_ratio: Array) -> float:
    """Half of the interval about zero that holds 95 % of weights [n] at ``log_ratio`` [n]; all above where less is below.

    A spread that may as well vanish has an interval with one end: 97.5 % lie below it.
    """
    order = np.argsort(np.abs(log_ratio))
    inside = np.cumsum(weight[order])
    both = float(np.interp(0.95, inside, np.abs(log_ratio)[order]))
    above = float(np.interp(0.975, np.cumsum(weight), log_ratio))
    return both if both <= max(above, 0.0) or log_ratio[0] < -both else above
