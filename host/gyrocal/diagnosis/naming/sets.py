"""Sets of effects whose signals overlap, compared as sets by held-out gain.

Slow effects share shapes: a warm-up, a temperature coefficient and a drift are all smooth curves of time in one power cycle.
If they are added one by one, the first one absorbs a part of the others, and the path may end at a wrong model. Here all sets
of up to ``Policy.largest_set`` effects are fitted beside the model. A set is *supported* if it predicts held-out data
significantly better than the model, and if every member is needed: without it, the others predict held-out data worse, and the
likelihood ratio of the member is significant. Of the supported sets, the one with the largest held-out gain is chosen, unless a
smaller one predicts as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.diagnosis.naming.decision import in_range
from gyrocal.diagnosis.naming.gains import held_out_gain, total
from gyrocal.diagnosis.naming.judge import added_parameters, judge
from gyrocal.diagnosis.naming.rivals import cosine
from gyrocal.diagnosis.naming.standing_model import Current
from gyrocal.effects.base import Effect, Objection
from gyrocal.error_model.model import Term
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.likelihood_ratio import likelihood_ratio
from gyrocal.inference.noise_search import fit_noise, with_noise
from gyrocal.inference.nonlinear import refine
from gyrocal.inference.reml import unknown_spreads
from gyrocal.inference.standard_errors import finish
from gyrocal.inference.structure import choose_variant
from gyrocal.inference.turns import reweighed
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array


@dataclass(frozen=True)
class EffectSet:
    """Effects fitted together beside a model on one axis.

    ``gains`` [units] are the gains in predictive log-likelihood of the held-out units over the model without the set, and
    ``parameters`` is the number of parameters that the set adds.
    """

    effects: tuple[Effect, ...]
    fitted: AxisFit = field(repr=False)
    gains: Array = field(repr=False)
    parameters: int

    @property
    def ids(self) -> frozenset[str]:
        """Ids of the effects."""
        return frozenset(e.id for e in self.effects)

    @property
    def gain(self) -> float:
        """Held-out log-likelihood that the set gains, summed over the units."""
        return float(self.gains.sum())


@dataclass(frozen=True)
class Choice:
    """The outcome of :func:`choose`.

    ``certain`` holds the effects that belong to every set that the session supports equally well. ``open`` holds the ids of the
    effects that belong only to some of these sets; it is empty if there is one best set.
    """

    certain: tuple[Effect, ...]
    open: tuple[str, ...]


def without(current: Current, ids: Sequence[str]) -> Current:
    """The current model without some effects on this axis, with its noise fitted again."""
    kept = [t for t in current.fit.design.terms if t.effect_id not in ids]
    if len(kept) == len(current.fit.design.terms):
        return current
    design = current.fit.design.changed(kept)
    fitted = finish(fit_noise(design, start=with_noise(design, current.fit.noise, unknown_spreads(design))))
    return Current(current.comparison, current.axis, fitted, changed=True)


def overlapping(lead: Candidate, others: Sequence[Candidate]) -> list[Effect]:
    """The lead's effect, and the effects on its axis whose fitted signals overlap with it, at most ``Policy.largest_pool``.

    Effects that are faster than a block and faults of the reading do not overlap with slow effects.
    """
    pool = [lead.effect]
    if lead.effect.fast or lead.signal is None:
        return pool
    near = [
        c for c in others
        if c.effect.id != lead.effect.id and c.axis == lead.axis and not c.effect.fast
        and cosine(lead.signal, c.signal) > POLICY.overlap and (c.gain or 0.0) > 0
    ]  # fmt: skip
    near.sort(key=lambda c: -(c.gain or 0.0))
    return [*pool, *(c.effect for c in near[: POLICY.largest_pool - 1])]


def choose(current: Current, pool: Sequence[Effect], tested: int) -> Choice:
    """Compare all sets of up to three effects of the ``pool`` beside the current model.

    ``tested`` is the number of candidates that the diagnosis tested, for the correction of the significance.
    """
    found: dict[frozenset[str], EffectSet] = {}
    found[frozenset()] = EffectSet((), current.fit, held_out_gain(current.fit, current.fit, current.folds), 0)
    supported: list[EffectSet] = []
    for size in range(1, POLICY.largest_set + 1):
        for members in combinations(pool, size):
            ids = frozenset(e.id for e in members)
            if any(frozenset(ids - {e}) not in found for e in ids):
                continue
            fitted = fitted_together(current, members)
            if fitted is None:
                continue
            gains = held_out_gain(current.fit, fitted, current.folds)
            found[ids] = EffectSet(members, fitted, gains, added_parameters(current.fit, fitted))
            needed = all(_needed(found[ids], found[ids - {e.id}], e, current, tested) for e in members)
            if needed and _certain(gains, POLICY.gain_errors):
                supported.append(found[ids])
    by_gain = sorted(supported, key=lambda s: -s.gain)
    best = next((s for s in by_gain if _sound(s, found, current)), None)
    supported = [
        s for s in by_gain[by_gain.index(best) :] if s is best or not (_as_good(s, best) and _excludes(best, s, current))
    ] if best is not None else []  # fmt: skip
    return _chosen(supported, current)


def fitted_together(current: Current, members: Sequence[Effect]) -> AxisFit | None:
    """The model with all members, fitted together; None if a member leaves its physical range, or what the runs can show."""
    if not members:
        return current.fit
    fitted = current.fit
    for effect in members:
        fitted = choose_variant(fitted, Term.of(effect, current.axis))
    fitted = finish(reweighed(refine(fitted)))
    for effect, term in zip(members, fitted.terms[-len(members) :], strict=True):
        physical = in_range(Candidate(effect, current.axis, "reject", term.values))
        if not physical or Objection.UNSEEN in effect.objections(term.values, current.runs, current.index, ()):
            return None
    return fitted


def _certain(gains: Array, errors: float) -> bool:
    """True if the sum of the gains [units] exceeds zero by a number of standard errors."""
    gain, gain_se = total(gains)
    return gain is not None and gain_se is not None and gain > errors * gain_se


def _needed(whole: EffectSet, rest: EffectSet, member: Effect, current: Current, tested: int) -> bool:
    """True if the set without the member explains the session worse on held-out data, and significantly worse in sample."""
    if not _certain(whole.gains - rest.gains, POLICY.member_errors):
        return False
    looks = member.looks(current.runs, current.index).shapes
    chance = likelihood_ratio(rest.fitted, whole.fitted, max(1, whole.parameters - rest.parameters))[1]
    return looks * chance * tested < POLICY.name_alarm


def _chosen(supported: Sequence[EffectSet], current: Current) -> Choice:
    if not supported:
        return Choice((), ())
    best = max(supported, key=lambda s: s.gain)
    equal = [s for s in supported if s is best or _as_good(s, best)]
    fewest = min(len(s.effects) for s in equal)
    simplest = [s for s in equal if len(s.effects) == fewest]
    simplest = [s for s in simplest if not any(_same_but_simpler(other, s, current) for other in simplest)]
    common = frozenset.intersection(*(s.ids for s in simplest))
    any_of = frozenset.union(*(s.ids for s in simplest))
    lead = max(simplest, key=lambda s: s.gain)
    certain = tuple(e for e in lead.effects if e.id in common)
    by_gain = sorted(simplest, key=lambda s: -s.gain)
    order = list(dict.fromkeys(e.id for s in by_gain for e in s.effects))
    return Choice(certain, tuple(i for i in order if i in any_of - common))


def _as_good(other: EffectSet, best: EffectSet) -> bool:
    """True if another set predicts as well as the best, within the error of the difference or the price of its parameters."""
    difference = best.gains - other.gains
    price = POLICY.parameter_gain * max(0, best.parameters - other.parameters)
    return float(difference.sum()) < max(POLICY.rival_errors * (total(difference)[1] or 0.0), price)


def _sound(whole: EffectSet, found: dict[frozenset[str], EffectSet], current: Current) -> bool:
    """True if no member, judged beside the others, is contradicted by what the effect is."""
    def beside_others(e: Effect) -> Current:
        return replace(current, fit=found[whole.ids - {e.id}].fitted, changed=True)

    return len(whole.effects) == 1 or not any(judge(beside_others(e), e).contradicted for e in whole.effects)


def _excludes(best: EffectSet, other: EffectSet, current: Current) -> bool:
    """True if all effects of both sets, fitted together, need those of the best set and not those of the other."""
    if other.ids <= best.ids or cosine(_change(best, current), _change(other, current)) > POLICY.same_shape:
        return False
    both = fitted_together(current, [*best.effects, *(e for e in other.effects if e.id not in best.ids)])
    if both is None:
        return False

    def chance_without(some: EffectSet) -> float:
        return likelihood_ratio(some.fitted, both, max(1, added_parameters(some.fitted, both)))[1]

    return chance_without(other) < POLICY.needed and chance_without(best) > POLICY.needless


def _same_but_simpler(other: EffectSet, than: EffectSet, current: Current) -> bool:
    """True if another set changes the residual in the same way with fewer parameters, and hardly predicts worse."""
    if other.parameters >= than.parameters:
        return False
    price = POLICY.parameter_gain * (than.parameters - other.parameters)
    same = cosine(_change(other, current), _change(than, current)) > POLICY.same_shape
    return same and than.gain - other.gain < price


def _change(of: EffectSet, current: Current) -> Array:
    """What a set takes from the residual of each block [blocks], deg/s, scaled by the square root of the number of samples.

    NaN for a block that the set or the model does not see.
    """
    runs = range(len(current.fit.design.blocks))
    before, after = (fit.design.over_given([fit.block_residuals(i) for i in runs]) for fit in (current.fit, of.fitted))
    return (before - after) * np.sqrt(np.concatenate([b.n for b in current.fit.design.given]))
