"""The candidates of an axis, judged beside each other.

Each candidate is judged beside the model alone. The signal of a strong cause can raise others that have nothing to do with
it: a dead band makes jumps, a lost carry makes wide waves, and a scale that differs with the direction makes the square of the
rate. A candidate keeps the decision ``add`` only if it still gains with the better ones of its axis in the model. A tone in
place of a line that belongs to another passed candidate is judged last. It is fitted to samples and the other to block means.
Their gains do not compare, and only the model with the other shows what is left for the tone.

Slow effects can also hide each other: a curve over temperature hides a hysteresis, and alone neither predicts held-out data.
Where no candidate of an axis passes, those that were suggested are compared as sets. Effects of time hide each other most: if a
delay and the clock's error cancel in the middle of the runs, a fit of one of them is wrong by many errors. They are compared as
a set also where one of them passes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gyrocal.diagnosis.naming.candidate import Candidate, number_tested
from gyrocal.diagnosis.naming.decision import evident_gain, has_size, in_range, meets, proven, sure_gain
from gyrocal.diagnosis.naming.explained import explained
from gyrocal.diagnosis.naming.gains import held_out_gain, total
from gyrocal.diagnosis.naming.judge import judge
from gyrocal.diagnosis.naming.sets import choose, fitted_together
from gyrocal.diagnosis.naming.standing_model import Current
from gyrocal.diagnosis.residual.comparison import Comparison
from gyrocal.effects.base import Effect, Objection
from gyrocal.effects.timing import TimingEffect
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES
from gyrocal.threads import each


def beside_better(candidates: Sequence[Candidate], comparison: Comparison) -> list[Candidate]:
    """The candidates; those with decision ``add`` that do not gain beside the better ones of their axis have ``suggest``.

    Rivals of a better one stay, because the session cannot tell which of them acts.
    """
    tested = number_tested(candidates)
    named, runs = [c for c in candidates if c.decision == "add"], comparison.fit.session.runs

    def of_another(c: Candidate) -> bool:
        known = [(o.effect, o.values) for o in named if o.axis == c.axis and o is not c]
        return Objection.REPEATS in c.effect.objections(c.values, runs, AXES.index(c.axis), known)

    passed = sorted(named, key=lambda c: (of_another(c), -(c.gain or 0.0)))

    def beside_first(axis: str) -> dict[int, Candidate]:
        first, *others = (c for c in passed if c.axis == axis)
        kept, changed = [first], dict[int, Candidate]()
        current, added = Current.of(comparison, axis), 0
        for c in others:
            if any(c.effect.id in better.group for better in kept):
                continue
            for better in kept[added:]:
                current = current.with_effect(better.effect, better.values)
            added = len(kept)
            again = judge(current, c.effect)
            if _gains(again, kept, tested):
                kept.append(c)
                changed[id(c)] = replace(c, gain_beside=again.gain)
            else:
                changed[id(c)] = replace(c, decision="suggest", group=())
        return changed

    axes = sorted({c.axis for c in passed if sum(other.axis == c.axis for other in passed) > 1})
    changed = {key: c for of_axis in each(beside_first, axes, comparison.fit.session.rows) for key, c in of_axis.items()}
    return [changed.get(id(c), c) for c in candidates]


def beside_sure(sure: Sequence[Candidate], others: Sequence[Candidate], comparison: Comparison) -> list[Candidate]:
    """Those of ``others`` that still gain with the ``sure`` ones of their axis in the model, with their values beside them.

    The evidence of sets has weighed them together. Alone they may gain nothing, because the error of the sure ones is larger.
    What those describe badly, such as readings that a jump spoiled, can gain too, but has no size beyond its error.
    """
    current = Current.of(comparison, sure[0].axis)
    for c in sure:
        current = current.with_effect(c.effect, c.values)
    known, out = [c.effect.id for c in sure], []
    for c in others:
        again = judge(current, c.effect)
        held_out = again.gain is None or evident_gain(again)
        if not again.values or again.contradicted or not in_range(again) or not held_out or not has_size(again):
            continue
        known.append(c.effect.id)
        current = current.with_effect(c.effect, again.values)
        out.append(replace(
            again, decision="add", q_value=c.q_value, group=(), together=tuple(known), log_odds=c.log_odds, checks=c.checks
        ))  # fmt: skip
    return out


def with_values_together(candidates: Sequence[Candidate], comparison: Comparison) -> list[Candidate]:
    """The candidates, of which several sure names of one axis have the values of the fit that holds them all.

    Alone, the value of one holds a part of the others. Waves and faults of the reading keep those by which they were found.
    """
    named = [c for c in candidates if c.named and c.log_odds is not None]

    def together(axis: str) -> dict[int, Candidate]:
        mine, current = [c for c in named if c.axis == axis], Current.of(comparison, axis)
        for c in mine:
            current = current.with_effect(c.effect, c.values)
        fitted = {t.effect_id: t for t in current.fit.terms if t.values}
        both = [(c, fitted[c.effect.id]) for c in mine if c.effect.id in fitted]
        return {id(c): replace(c, values=dict(t.values), se=dict(t.se)) for c, t in both if t.values.keys() == c.values.keys()}

    axes = sorted({c.axis for c in named if sum(other.axis == c.axis for other in named) > 1})
    changed = {key: c for of_axis in each(together, axes, comparison.fit.session.rows) for key, c in of_axis.items()}
    return [changed.get(id(c), c) for c in candidates]


def excludes(c: Candidate, rival: Candidate, comparison: Comparison) -> bool:
    """True if a candidate is needed beside a rival, and the rival is not needed beside the candidate (encompassing).

    A few held-out units have a large error of their difference. The likelihood ratios of the model with both know more
    (Mizon and Richard, Econometrica 54 (1986) 657).
    """
    current = Current.of(comparison, c.axis)

    def chance_beside(known: Candidate, other: Candidate) -> float:
        return judge(current.with_effect(known.effect, known.values), other.effect, unless=0.0).chance

    return chance_beside(rival, c) < POLICY.needed and chance_beside(c, rival) > POLICY.needless


def _gains(again: Candidate, better: Sequence[Candidate], tested: int) -> bool:
    """True if a candidate is proven beside the better ones.

    Two faults of the reading are found in the same codes, so that a second one must also improve the prediction.
    """
    same_codes = any(c.effect.fault_of(c.values) is not None or c.effect.fault is not None for c in better)
    if same_codes and again.effect.fault_of(again.values) is not None and not sure_gain(again):
        return False
    return bool(again.values) and proven(again, tested) and in_range(again) and not again.contradicted


def as_sets(candidates: Sequence[Candidate], comparison: Comparison) -> list[Candidate]:
    """The candidates; the members of the best set of an axis have decision ``add``, with their values beside each other.

    Sets are compared on axes with a finding and without a name. Effects of time are compared on every axis on which one of them
    was suggested.
    """
    tested = number_tested(candidates)
    found = {f.axis for f in comparison.where} - {c.axis for c in candidates if c.decision == "add"}
    out = list(candidates)
    for axis in comparison.judged:
        runs = comparison.fit.session.runs
        slow = [
            c for c in candidates
            if c.axis == axis and c.signal is not None and not c.effect.fast and c.effect.scope_in(runs) == "session"
        ]  # fmt: skip
        suggested = [c for c in slow if c.decision == "suggest" and not c.contradicted]
        changed = _in_time([c for c in slow if isinstance(c.effect, TimingEffect) and not _refuted(c)], comparison, tested)
        if axis in found and len(suggested) > 1 and not any(c.decision == "add" for c in changed.values()):
            pool = sorted(suggested, key=lambda c: c.chance)[: POLICY.largest_pool]
            changed |= _set_of(pool, comparison, tested)
        out = [changed.get(c.effect.id, c) if c.axis == axis else c for c in out]
    return out


def _refuted(c: Candidate) -> bool:
    """True if another axis contradicts an effect that the whole recording shares."""
    return isinstance(c.effect, TimingEffect) and c.effect.of_recording and c.contradicted


def _in_time(pool: Sequence[Candidate], comparison: Comparison, tested: int) -> dict[str, Candidate]:
    """Effects of time of one axis by id, with their values beside each other if noise explains none of them there.

    The set is named if it is certain. Else each keeps its decision and is at least suggested.
    """
    if len(pool) < 2 or not any(c.decision in ("add", "suggest") for c in pool):
        return {}
    named = _set_of(pool, comparison, tested)
    if len(named) == len(pool) and all(c.together for c in named.values()):
        return named
    current, changed = Current.of(comparison, pool[0].axis), {}
    for c in pool:
        others = fitted_together(current, [other.effect for other in pool if other is not c])
        again = None if others is None else judge(replace(current, fit=others, changed=True), c.effect)
        if again is None or again.chance * tested >= POLICY.name_alarm:
            return {}
        changed[c.effect.id] = replace(
            again, decision="add" if c.decision == "add" else "suggest", group=c.group,
            together=tuple(c.effect.id for c in pool), q_value=min(1.0, again.chance * tested),
        )  # fmt: skip
    return changed


def _set_of(pool: Sequence[Candidate], comparison: Comparison, tested: int) -> dict[str, Candidate]:
    """The members of the best set of one axis by id, each with its evidence beside the others."""
    current = Current.of(comparison, pool[0].axis)
    choice = choose(current, [c.effect for c in pool], tested)
    if choice.certain and not meets(_as_one(choice.certain, current), comparison):
        return {}
    ids = tuple(e.id for e in choice.certain)
    changed = {}
    for effect in choice.certain:
        others = fitted_together(current, [e for e in choice.certain if e is not effect])
        if others is not None:
            again = judge(replace(current, fit=others, changed=True), effect)
            changed[effect.id] = replace(
                again, decision="add", group=(effect.id,), together=ids if len(ids) > 1 else (),
                q_value=min(1.0, again.chance * tested),
            )  # fmt: skip
    for c in pool:
        if choice.open and c.effect.id == choice.open[0]:
            changed[c.effect.id] = replace(c, decision="add", group=choice.open)
    return changed


def _as_one(members: Sequence[Effect], current: Current) -> Candidate:
    """A set as one candidate with its held-out gain and the part of the excess that it explains."""
    fitted = fitted_together(current, members)
    if fitted is None:
        return Candidate(members[0], current.axis, "reject")
    gain = total(held_out_gain(current.fit, fitted, current.folds))[0]
    part = explained(current, fitted, np.zeros(0), chance=0.0).part
    return Candidate(members[0], current.axis, "suggest", gain=gain, explained=part)
