"""One day's model held against another day's movements: does it still hold, and what has moved?

The movements are predicted with the model's own parameters. Their noise, and the session's own estimates of the parameters,
come from a fit of the same model to this session. The offset of a power cycle may be as large as the larger one of the model's
spread and the session's allows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from gyrocal.diagnosis.answer.as_is import ROLES, remark, with_values, words
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.diagnosis.residual.parameter_moved import Moved, parameters_moved, strongest_first
from gyrocal.effects.base import Role, with_role
from gyrocal.error_model.model import Model, Term
from gyrocal.gravity.compare import Comparison, findings, level_by_axis, measure
from gyrocal.gravity.fit import GravityFit, Wander, total_noise
from gyrocal.gravity.heldout import HeldOut
from gyrocal.gravity.naming import candidates
from gyrocal.gravity.observations import Observer, parameters
from gyrocal.inference.heldout import SESSION
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array, Session


def compare_as_is(session: Session, model: Model | str | Path | None) -> Comparison:
    """Hold a model against a session without fitting its parameters. Raises InputError if the model has none of its own."""
    opened = with_values(model)
    own = measure(session, opened)
    fitted, held = _kept(own.fit, opened)
    moved = [
        row for t in opened.terms
        for row in parameters_moved(t, _own_term(own.fit, t), _offset_dps(own.fit, opened, t) ** 2)
    ]  # fmt: skip
    where = [*_findings(moved), *own.where]
    if not where and not own.implausible:
        where = findings(own, candidates(own.evidence))
    pooled = held.level(np.arange(len(fitted.scene.movements)))
    said = (own.note, remark(opened, _unknown_offsets(own.fit, opened)))
    return replace(
        own, fit=fitted, pooled=pooled, per_axis=level_by_axis(fitted, held), where=where, held_out=SESSION, held=held,
        moved=strongest_first(moved), note=" ".join(part for part in said if part),
    )  # fmt: skip


def _own_term(own: GravityFit, term: Term) -> Term | None:
    return None if term.effect_id in own.left_out else own.model.term(term.effect_id, term.axis)


def _spread_dps(own: GravityFit, model: Model, axis: str) -> float:
    """The spread of an axis's bias over power cycles as the model states it, deg/s.

    If it states none and there is one power cycle, the offset of this cycle is all that tells its size.
    """
    turn_on, bias = model.noise_on(axis).turn_on_bias, with_role(Role.BIAS).id
    if axis in _unknown_offsets(own, model):
        name = with_role(Role.BIAS).linear[0]
        return abs(own.model.value(bias, axis, name) - model.value(bias, axis, name))
    return 0.0 if turn_on is None or turn_on.sd_dps is None else turn_on.sd_dps


def _unknown_offsets(own: GravityFit, model: Model) -> list[str]:
    """The axes on which neither the session nor the model tells how much the bias differs between power cycles."""
    spreads = {axis: model.noise_on(axis).turn_on_bias for axis in AXES}
    several = len(own.scene.cycles) > 1
    return [] if several else [axis for axis, of in spreads.items() if of is not None and of.sd_dps is None]


def _offset_dps(own: GravityFit, model: Model, term: Term) -> float:
    """By how much the session's own bias may differ from that of all power cycles, beyond its standard error, deg/s."""
    if term.effect.role is not Role.BIAS:
        return 0.0
    counted = own.wander[AXES.index(term.axis)].turn_on_sd_dps
    return float(np.sqrt(max(_spread_dps(own, model, term.axis) ** 2 - counted**2, 0.0) / len(own.scene.cycles)))


def _kept(own: GravityFit, model: Model) -> tuple[GravityFit, HeldOut]:
    """The model with its own values, and what it leaves of the movements."""
    terms = [t for t in model.terms if t.values and t.effect_id not in own.left_out]
    wanted = parameters(terms)
    seen = Observer(own.scene).observe(replace(model, terms=tuple(terms)), wanted, own.observations.rates_dps)
    theta = np.array([p.term.values[p.name] for p in wanted])
    wander = tuple(
        Wander(w.drift, max(w.turn_on_sd_dps, _spread_dps(own, model, axis))) for w, axis in zip(own.wander, AXES, strict=True)
    )
    noise = total_noise(seen, wander)
    covariance = _of_model(own, [p.key for p in wanted], np.array([p.term.se.get(p.name, 0.0) for p in wanted]))
    expected = noise + seen.columns @ covariance @ seen.columns.T
    rows = seen.movement_rows
    residual = seen.y - seen.columns @ theta
    residual[rows:] = np.nan
    pairs = [slice(k, k + 2) for k in range(0, rows, 2)]
    fourth = np.array([float(np.sum(expected[two, two] ** 2)) for two in pairs])
    held = HeldOut(residual, np.diag(expected), fourth, np.zeros(1), rows)
    stated = replace(model, noise=own.model.noise)
    return GravityFit(own.scene, stated, wanted, theta, covariance, seen, noise, wander, own.left_out), held


def _of_model(own: GravityFit, keys: Sequence[tuple[str, str, str]], se: Array) -> Array:
    """Covariance [p, p] of the model's parameters: their own errors, correlated as a session like this one correlates them."""
    place = {p.key: k for k, p in enumerate(own.parameters)}
    index = [place[key] for key in keys]
    cov = own.covariance[np.ix_(index, index)]
    factor = se / np.sqrt(np.diag(cov))
    return np.asarray(np.outer(factor, factor) * cov)


def _findings(moved: Sequence[Moved]) -> list[Finding]:
    """The parameters that have moved by more than chance, strongest first."""
    known = [m for m in moved if m.z is not None]
    share = POLICY.moved_alarm / max(1, len(known))
    out = [
        Finding(m.axis, ROLES[m.role or Role.SCALE], abs(m.z or 0.0), m.chance, 0.0, words(m))
        for m in known if m.chance < share
    ]  # fmt: skip
    return sorted(out, key=lambda f: -f.strength)
