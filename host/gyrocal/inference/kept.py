"""A model's own parameters held against a session: nothing is fitted but the noise and the offsets of its power cycles.

The session's own estimates are fitted first, about the model's values: what the session does not show stays at the model's
value. The noise of that fit is the noise of the session, because a parameter that has moved would otherwise count as noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gyrocal.effects.base import Role
from gyrocal.effects.timing import TimingEffect
from gyrocal.error_model.model import Model, Term
from gyrocal.inference.design import Design
from gyrocal.inference.fitted import AxisFit, Fit
from gyrocal.inference.reml import Solution, Spreads, solve
from gyrocal.noise.axis import AxisNoise
from gyrocal.recording.session import Array


@dataclass(frozen=True)
class Kept:
    """``fit`` holds the model's own values. The coefficients of each axis differ from them by ``change`` [p] in this session,
    with the covariance ``of_session`` [p, p] in the session and ``of_model`` [p, p] in the model.
    """

    fit: Fit
    change: dict[str, Array]
    of_session: dict[str, Array]
    of_model: dict[str, Array]
    unknown_offset: tuple[str, ...]
    """The axes on which nothing tells how much the bias differs between power cycles: there is one; the model has no spread."""

    def of_cycles(self, axis: str, own: AxisFit, role: Role | None) -> float:
        """The variance that a role's spread over power cycles adds to the error of the session's own estimate."""
        design, noise = self.fit.axes[axis].design, self.fit.axes[axis].noise_model
        if role is None:
            return 0.0
        if role is Role.BIAS and axis in self.unknown_offset:
            return _offset(design, self.change[axis]) ** 2
        counted = own.scenario_sd(own.spreads.scenario, role)
        return max(_sd(role, noise) ** 2 - counted**2, 0.0) / design.cycles


def kept(own: Fit, model: Model) -> Kept:
    """The model held against the session of ``own``, the fit of the same model about its values."""
    axes: dict[str, AxisFit] = {}
    change, of_session, of_model, unknown = {}, {}, {}, []
    noise = dict(model.noise)
    for axis, fitted in own.axes.items():
        terms = [t for t in model.on(axis) if t.values]
        if not terms:
            continue
        noise[axis] = _noise(fitted, model.noise_on(axis))
        held, free = _held(fitted, terms, noise[axis])
        axes[axis] = held
        change[axis], of_session[axis] = free.beta, free.cov
        sizes = np.sqrt(np.maximum(np.diag(free.cov), 1e-300))
        stated = _stated_errors(held.design, terms)
        of_model[axis] = np.outer(stated / sizes, stated / sizes) * free.cov
        if held.design.cycles == 1:
            of_model[axis] += _of_one_cycle(held.design, noise[axis])
            turn_on = noise[axis].turn_on_bias
            if turn_on is not None and turn_on.sd_dps is None:
                unknown.append(axis)
                of_model[axis] += _of_unknown_offset(held.design, free.beta)
    fit = Fit(own.session, own.blocks, replace(model, noise=noise), axes)
    return Kept(fit, change, of_session, of_model, tuple(unknown))


def _noise(own: AxisFit, stated: AxisNoise) -> AxisNoise:
    """The noise of the session; the spreads over power cycles are the larger of the model's and the session's.

    An offset that the model's spread allows is no change of the bias, however well the power cycles of this session agree.
    """
    found = own.noise_model
    bias, scale = stated.turn_on_bias, stated.turn_on_scale
    if bias is not None and bias.sd_dps is not None and (own.turn_on_sd_dps <= bias.sd_dps):
        found = replace(found, turn_on_bias=bias)
    if scale is not None and (found.turn_on_scale is None or found.turn_on_scale.sd <= scale.sd):
        found = replace(found, turn_on_scale=scale)
    return found


def _held(own: AxisFit, terms: Sequence[Term], noise: AxisNoise) -> tuple[AxisFit, Solution]:
    """The axis with the terms' values, and the solution in which their linear parameters are free."""
    old = own.design
    runs = [b.run for b in old.given]
    about = {
        t.effect_id: t.values for t in terms
        if t.fault is None and not isinstance(t.effect, TimingEffect)
        and (t.effect.scope_in(runs) == "session" or t.effect.common_mean)
    }  # fmt: skip
    design = Design(old.given, old.axis, terms, noise, old.cell_s, color=old.color, about=about)
    spreads = Spreads(_of_runs(design), _of_cycles(design, noise))
    grams, logdet = design.grams(own.noise)
    free = solve(design.layout, grams, logdet, design.scenarios, int(design.n_blocks.sum()), spreads)
    p = len(design.layout.fixed)
    nothing = Solution(free.loglik, np.zeros(p), np.zeros((p, p)), free.chi2)
    held = AxisFit(design, own.noise, spreads, nothing, tuple(terms), grams, logdet, noise)
    return held, free


def _of_runs(design: Design) -> Array:
    """The spread [groups] of the coefficients that differ from run to run, as the terms' values say."""
    out = np.zeros(design.layout.n_groups)
    for (i, j), group in zip(design.layout.run, design.layout.run_group, strict=True):
        out[group] = design.terms[i].effect.coding.spread(design.terms[i].values)[j]
    return out


def _sd(role: Role | None, noise: AxisNoise) -> float:
    bias, scale = noise.turn_on_bias, noise.turn_on_scale
    if role is Role.BIAS:
        return 0.0 if bias is None or bias.sd_dps is None else bias.sd_dps
    return 0.0 if scale is None else scale.sd


def _of_cycles(design: Design, noise: AxisNoise) -> Array:
    """The spread [k] of each coefficient that varies over power cycles."""
    return np.array([_sd(design.terms[design.layout.fixed[j][0]].effect.role, noise) for j in design.layout.scenario])


def _of_one_cycle(design: Design, noise: AxisNoise) -> Array:
    """Covariance [p, p] by which bias and scale of a single power cycle differ from those of all, as the model states it."""
    roles = [design.terms[i].effect.role for i, _ in design.layout.fixed]
    return np.diag([0.0 if role is None else _sd(role, noise) ** 2 for role in roles])


def _of_unknown_offset(design: Design, change: Array) -> Array:
    """The same [p, p] where no spread is known: the offset of this power cycle is all that tells its size."""
    roles = [design.terms[i].effect.role for i, _ in design.layout.fixed]
    return np.diag([_offset(design, change) ** 2 if role is Role.BIAS else 0.0 for role in roles])


def _offset(design: Design, change: Array) -> float:
    """By how much the bias has changed, deg/s."""
    roles = [design.terms[i].effect.role for i, _ in design.layout.fixed]
    return float(sum(abs(c) for c, role in zip(change, roles, strict=True) if role is Role.BIAS))


def _stated_errors(design: Design, terms: Sequence[Term]) -> Array:
    """The standard error [p] of each shared coefficient that the terms' own errors give."""
    out = np.zeros(len(design.layout.fixed))
    for k, (i, j) in enumerate(design.layout.fixed):
        effect, values, se = terms[i].effect, terms[i].values, terms[i].se
        at = effect.coding.coefficients(values)
        known = [(name, error) for name, error in se.items() if name in values]
        moves = [effect.coding.coefficients({**values, name: values[name] + error}) - at for name, error in known]
        out[k] = float(np.sqrt(sum(m[j] ** 2 for m in moves)))
    return out
