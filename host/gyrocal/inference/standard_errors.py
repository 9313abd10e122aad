"""The parameters of a fitted axis by name, with their standard errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gyrocal.effects.base import Role, Values
from gyrocal.error_model.model import Term
from gyrocal.inference.beside_drift import drift_factor
from gyrocal.inference.carried_drift import carried_factor
from gyrocal.inference.contradictions import misfit_factor
from gyrocal.inference.few_cycles import widening
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.joint import Joint, errors_of, joint
from gyrocal.inference.spread_errors import settled, spread_errors
from gyrocal.inference.turns import widening_by_turns
from gyrocal.noise.axis import AxisNoise
from gyrocal.noise.drift import Drift
from gyrocal.noise.power_cycles import TurnOnBias, TurnOnScale
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array


def finish(current: AxisFit, reported: bool = False, misfit: bool = False) -> AxisFit:
    """The fit with its terms and noise as a model holds them: parameters by name, with their standard errors.

    Only if they are ``reported``, the errors contain what the drift leaves unknown of the spreads, and what it adds where it
    goes on from run to run; that takes longer. Where the tests of the residual have found a ``misfit``, the errors contain what
    parts of the data that contradict each other leave open.
    """
    current = settled(current)
    layout, design = current.design.layout, current.design
    run_se, scenario_se = spread_errors(current)
    factor, carried = widening(current) * widening_by_turns(current), np.ones(current.solution.beta.size)
    if reported:
        scenario_se, carried = scenario_se * drift_factor(current, scenario_se), carried_factor(current)
    if misfit:
        factor = factor * misfit_factor(current)
    together = joint(current)
    of_term = {i: [carried[j] for j, (t, _) in enumerate(layout.fixed) if t == i] for i, _ in together.nonlinear}
    together = together.widened(factor * carried, np.array([max(of_term[i], default=1.0) for i, _ in together.nonlinear]))
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
            shared, shared_se = _named(term, current, together, mine)
            values.update(shared)
            se.update(shared_se)
        own = [j for j, (t, _) in enumerate(layout.run) if t == i]
        if own:
            groups = [layout.run_group[j] for j in own]
            values.update(kind.coding.named_spread(current.spreads.run[groups], term.values))
            se.update(kind.coding.named_spread(run_se[groups], term.values))
        se.update(_nonlinear_errors(current, i, together))
        values.update({name: term.values[name] for name in term.held})
        terms.append(replace(term, values=values, se=se))
    return replace(current, terms=tuple(terms), noise_model=_fitted_noise(current, scenario_se))


def _fitted_noise(current: AxisFit, scenario_se: Array) -> AxisNoise:
    """The noise as fitted, with the standard errors of the spreads over power cycles."""
    wanted, fitted = current.design.noise_model, AxisNoise(current.noise.white_sd_dps)
    if wanted.drift is not None:
        fitted = fitted.having(Drift(current.noise.ou_sd_dps, current.noise.ou_tau_s))
    known = current.design.cycles >= POLICY.least_scenarios
    if wanted.turn_on_bias is not None:
        se = {"sd_dps": current.scenario_sd(scenario_se, Role.BIAS)}
        fitted = fitted.having(TurnOnBias(current.turn_on_sd_dps, se=se) if known else TurnOnBias())
    if known and len(current.design.layout.scenario) > 1:
        sd, sd_se = (current.scenario_sd(of, Role.SCALE) for of in (current.spreads.scenario, scenario_se))
        fitted = replace(fitted, turn_on_scale=TurnOnScale(sd, sd_se))
    return fitted


def _named(term: Term, current: AxisFit, of: Joint, mine: list[int]) -> tuple[Values, Values]:
    """A term's shared parameters by name, and their errors; those that are not identified are left out."""
    kind, layout = term.effect, current.design.layout
    index = [layout.fixed[j][1] for j in mine]
    full = np.full(max(len(kind.coding.groups(term.values)), max(index) + 1), np.nan)
    full[index] = current.solution.beta[mine] + current.design.origin[mine]
    values = {n: v for n, v in kind.coding.named(full, term.values).items() if np.isfinite(v)}

    def named(beta: Array, _: Array) -> Array:
        moved = full.copy()
        moved[index] = beta[mine] + current.design.origin[mine]
        found = kind.coding.named(moved, term.values)
        return np.array([found[n] for n in values])

    # what the noise of measured columns leaves unknown adds to the error of the fit, and so do the columns that it left out
    besides = np.diag(current.attenuation_se**2) + sum(np.outer(shift, shift) for _, shift in current.design.left_out)
    errors = np.hypot(of.errors(named), errors_of(lambda beta: named(beta, np.zeros(0)), current.solution.beta, besides))
    return values, dict(zip(values, map(float, errors), strict=True))


def _nonlinear_errors(current: AxisFit, i: int, of: Joint) -> Values:
    """Errors of a term's nonlinear parameters.

    Where the likelihood has steps, the truth is uniformly distributed between two of them, with a standard deviation of half
    their distance over the square root of three.
    """
    mine = [k for k, (term, _) in enumerate(of.nonlinear) if term == i]
    errors = of.errors(lambda _, log_values: np.exp(log_values[mine])) if mine else np.zeros(0)
    term, runs = current.design.terms[i], [b.run for b in current.design.blocks]
    names = [of.nonlinear[k][1] for k in mine]
    spacing = [term.effect.refinement(name, term.values, runs, current.design.axis).resolution for name in names]
    return {name: float(max(e / 3**0.5, s) if s else e) for name, e, s in zip(names, errors, spacing, strict=True)}
