"""The parameters of a fitted axis by name, with their standard errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gyrocal.effects.base import Role, Values
from gyrocal.error_model.model import Term
from gyrocal.inference.design import LEAST_SCENARIOS
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.noise_search import with_noise
from gyrocal.inference.reml import Spreads, SpreadScale
from gyrocal.noise.axis import AxisNoise
from gyrocal.noise.drift import Drift
from gyrocal.noise.power_cycles import TurnOnBias, TurnOnScale
from gyrocal.recording.session import Array


def finish(current: AxisFit) -> AxisFit:
    """The fit with its terms and noise as a model holds them: parameters by name, with their standard errors."""
    layout, design = current.design.layout, current.design
    run_se, scenario_se = _spread_errors(current)
    terms = []
    for i, term in enumerate(design.terms):
        kind = term.effect
        values: Values = {n: v for n, v in kind.structure(term.values).items() if n not in kind.linear}
        se: Values = {}
        if term.of_run:
            values |= {n: v for n, v in term.values.items() if n in term.se}
            se |= term.se
        mine = [j for j, (t, _) in enumerate(layout.fixed) if t == i]
        if term.fault is not None:
            values, se = dict(term.values), dict(term.se)
        if mine:
            shared, shared_se = _named(term, current, mine)
            values.update(shared)
            se.update(shared_se)
        own = [j for j, (t, _) in enumerate(layout.run) if t == i]
        if own:
            groups = [layout.run_group[j] for j in own]
            values.update(kind.named_spread(current.spreads.run[groups], term.values))
            se.update(kind.named_spread(run_se[groups], term.values))
        se.update(_nonlinear_errors(current, i))
        terms.append(replace(term, values=values, se=se))
    return replace(current, terms=tuple(terms), noise_model=_fitted_noise(current, scenario_se))


def _fitted_noise(current: AxisFit, scenario_se: Array) -> AxisNoise:
    """The noise as fitted, with the standard errors of the spreads over power cycles."""
    wanted, fitted = current.design.noise_model, AxisNoise(current.noise.white_sd_dps)
    if wanted.drift is not None:
        fitted = fitted.having(Drift(current.noise.ou_sd_dps, current.noise.ou_tau_s))
    if wanted.turn_on_bias is not None:
        known = np.unique(current.design.scenarios).size >= LEAST_SCENARIOS
        se = {"sd_dps": current.scenario_sd(scenario_se, Role.BIAS)}
        fitted = fitted.having(TurnOnBias(current.turn_on_sd_dps, se=se) if known else TurnOnBias())
    if len(current.design.layout.scenario) > 1:
        sd, sd_se = (current.scenario_sd(of, Role.SCALE) for of in (current.spreads.scenario, scenario_se))
        fitted = replace(fitted, turn_on_scale=TurnOnScale(sd, sd_se))
    return fitted


def _named(term: Term, current: AxisFit, mine: list[int]) -> tuple[Values, Values]:
    """A term's shared parameters by name, and their errors by propagation; those that are not identified are left out."""
    kind, layout = term.effect, current.design.layout
    index = [layout.fixed[j][1] for j in mine]
    beta = np.full(max(len(kind.groups(term.values)), max(index) + 1), np.nan)
    beta[index] = current.solution.beta[mine] + current.design.origin[mine]
    cov = current.solution.cov[np.ix_(mine, mine)]
    values = {n: v for n, v in kind.named(beta, term.values).items() if np.isfinite(v)}
    slopes = np.zeros((len(values), len(mine)))
    for k, j in enumerate(index):
        moved = beta.copy()
        step = 1e-3 * float(np.sqrt(cov[k, k]))
        moved[j] += step
        changed = kind.named(moved, term.values)
        slopes[:, k] = [(changed[n] - v) / step for n, v in values.items()]
    errors = np.sqrt(np.maximum(np.einsum("ik,kl,il->i", slopes, cov, slopes), 0.0))
    return values, dict(zip(values, map(float, errors), strict=True))


def _spread_errors(current: AxisFit) -> tuple[Array, Array]:
    """Standard errors of the spreads: from the curvature of REML's log-likelihood in their logarithm.

    Of a spread that vanishes, or that has no curvature, the size at which the log-likelihood has fallen by a half.
    """
    sd = np.concatenate([current.spreads.run, current.spreads.scenario])
    k = current.spreads.run.size
    everything = np.ones(len(current.design.blocks), dtype=bool)
    unit = SpreadScale.of(current.design, current.grams).unit

    def loglik(j: int, value: float) -> float:
        trial = sd.copy()
        trial[j] = value
        return current.subset(everything, Spreads(trial[:k], trial[k:])).loglik

    out = np.full(sd.size, np.nan)
    step = 0.1
    for j in np.flatnonzero(unit > 0).tolist():
        lower, upper = (loglik(j, sd[j] * float(np.exp(sign))) for sign in (-step, step))
        curvature = (2 * current.loglik - lower - upper) / step**2
        if sd[j] > 0 and curvature > 0.05:
            out[j] = sd[j] / np.sqrt(curvature)
            continue
        low, high = np.log(1e-3 * unit[j]), np.log(1e3 * unit[j])
        for _ in range(12):
            middle = (low + high) / 2
            fallen = current.loglik - loglik(j, float(np.hypot(sd[j], np.exp(middle)))) > 0.5
            low, high = (low, middle) if fallen else (middle, high)
        out[j] = np.exp(high)
    return out[:k], out[k:]


def _nonlinear_errors(current: AxisFit, i: int) -> Values:
    term = current.design.terms[i]
    errors: Values = {}
    if term.of_run:
        return errors
    runs = [b.run for b in current.design.blocks]
    for name in term.effect.nonlinear:
        if name not in term.values:
            continue
        step = term.effect.step(name, term.values, runs) / 6
        ends = []
        for sign in (-step, step):
            moved = current.design.with_values(i, {name: term.values[name] * float(np.exp(sign))})
            ends.append(with_noise(moved, current.noise, current.spreads).loglik)
        curvature = (2 * current.loglik - ends[0] - ends[1]) / step**2
        errors[name] = float(term.values[name] / np.sqrt(curvature)) if curvature > 0 else float("nan")
    return errors
