"""Explain a session: diagnose it, add what is certain, and repeat until nothing is left or nothing is certain.

Each step starts from the diagnosis of the model so far. The first candidate with decision ``add`` leads. One that is sure by
itself comes before one of several that cannot be told apart, because they often can with the sure one in the model. Effects
whose signals overlap with its signal, including those that an earlier step added, are compared as sets
(:mod:`gyrocal.diagnosis.naming.sets`). What every equally good set contains is added. What only some of them contain stays
open, with the measurement that decides. A step is taken back if it decreases neither the held-out excess of all axes nor the
held-out error of one of its own, unless the diagnosis is sure of its effect: the likelihood of held-out data, on which a
name rests, knows what is noise, and sees effects that their squares do not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from gyrocal.diagnosis.answer.diagnose import Diagnosis, diagnose
from gyrocal.diagnosis.naming.candidate import Candidate, number_tested
from gyrocal.diagnosis.naming.decision import significant
from gyrocal.diagnosis.naming.judge import added_parameters, judge
from gyrocal.diagnosis.naming.sets import choose, overlapping, without
from gyrocal.diagnosis.naming.standing_model import Current
from gyrocal.diagnosis.residual.comparison import Comparison, with_floor_of
from gyrocal.effects import base
from gyrocal.effects.base import Effect
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.inference.likelihood_ratio import likelihood_ratio
from gyrocal.policy import POLICY
from gyrocal.recording.session import Session
from gyrocal.shown import Shown
from gyrocal.threads import one_thread

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Step:
    """Effects that were added together, with the comparisons before and after over the same noise floor.

    ``removed`` lists effects of an earlier step that this step's set replaces. ``matters`` is False if the effects are certain
    but, without them, the error of the final model would hardly be larger. ``within`` is True if the step was judged by the
    excess within power cycles, because the offsets of a few power cycles hide its decrease in the whole excess.
    """

    effects: tuple[str, ...]
    axes: tuple[str, ...]
    removed: tuple[str, ...]
    before: Comparison = field(repr=False)
    after: Comparison = field(repr=False)
    matters: bool = True
    within: bool = False
    found: Diagnosis | None = field(default=None, repr=False)
    """The diagnosis that the step was taken from."""

    @property
    def excess_before(self) -> float | None:
        """The excess of all axes before the step by which the step was judged, deg/s, or deg if judged by angle."""
        return _excess(self.before, self.within)

    @property
    def excess_after(self) -> float | None:
        """The same excess after the step."""
        return _excess(self.after, self.within)

    def to_json(self) -> dict[str, Any]:
        unit = "dps" if self.before.angles is None else "deg"
        return {
            "effects": list(self.effects), "axes": list(self.axes), "removed": list(self.removed),
            f"excess_before_{unit}": self.excess_before, f"excess_after_{unit}": self.excess_after,
            "excess": "within power cycles" if self.within else "all", "matters": self.matters,
        }  # fmt: skip


@dataclass(frozen=True)
class Open:
    """Effects on one axis that the session cannot tell apart, or one that it cannot prove, and the measurement that would."""

    group: tuple[str, ...]
    axis: str
    next_measurement: str

    def to_json(self) -> dict[str, Any]:
        return {"group": list(self.group), "axis": self.axis, "next_measurement": self.next_measurement}


class Concluded:
    """What the diagnosis of the final model, ``last``, concludes."""

    last: Any

    @property
    def verdict(self) -> str:
        """The verdict on the final model."""
        return str(self.last.verdict)

    @property
    def model(self) -> Model:
        """The final model, with its parameters fitted to all data."""
        fitted: Model = self.last.comparison.fit.model
        return fitted


@dataclass(frozen=True, repr=False, eq=False)
class Explanation(Concluded, Shown):
    """The result of :func:`explain`. ``first`` and ``last`` are the diagnoses of the given model and of the final model."""

    steps: list[Step]
    left: list[Open]
    first: Diagnosis = field(repr=False)
    last: Diagnosis = field(repr=False)
    limited: bool = False
    """True if it ended because no more steps were allowed."""

    def to_json(self) -> dict[str, Any]:
        compared = self.last.comparison.to_json()
        return {
            "steps": [s.to_json() for s in self.steps],
            "residual": compared["residual"],
            "left": [o.to_json() for o in self.left],
            "verdict": self.verdict,
            "model": compared["model"],
            "parameters": compared["parameters"],
            "unknown": self.last.unknown,
            "warnings": compared["warnings"],
        }


@one_thread
def explain(
    session: Session, model: Model | str | Path | None = None, *, most_steps: int = POLICY.most_steps,
    progress: Progress | None = None,
) -> Explanation:  # fmt: skip
    """Add effects to a model as long as one is certain, and state what stays open or unknown.

    ``most_steps`` limits the number of steps. Raises InputError where
    :func:`gyrocal.diagnosis.answer.diagnose.diagnose` does, and for a negative ``most_steps``.
    """
    if most_steps < 0:
        raise InputError(f"--max is {most_steps}; give the largest number of steps, 0 or more")
    start = Model.open(model)
    first = last = diagnose(session, start, progress=progress)
    steps: list[Step] = []
    added: dict[str, list[str]] = {}
    refused: set[tuple[str, frozenset[str]]] = set()
    dropped: set[tuple[str, str]] = set()
    while True:
        plans = list(_plans(last, added, progress))
        left = [plan.left for plan in plans if plan.left is not None]
        tried = iter(plans if len(steps) < most_steps else ())
        taken = next(filter(None, (_taken(session, last, plan, refused, progress) for plan in tried)), None)
        if taken is None:
            limited = len(steps) >= most_steps
            vain = [] if limited else [p for p in plans if p.new]
            left += [Open(tuple(e.id for e in p.new), p.lead.axis, p.lead.next_measurement) for p in vain]
            steps = [_over_one_floor(s, last.comparison) for s in steps]
            return Explanation(steps, [*left, *_unproven(last)], first, last, limited)
        step, last = _without_needless(session, *taken, added, dropped, progress)
        steps.append(step)
        refused.clear()  # what did not decrease the excess beside a larger error may do so now
        for axis in step.axes:
            model = last.comparison.fit.model
            known = [*added.get(axis, []), *step.effects]
            added[axis] = [i for i in known if any(t.effect_id == i for t in model.on(axis))]


REPEAT = "record the same runs again in another power cycle; no run of this session can be left out to test a prediction"


def _unproven(diagnosis: Diagnosis) -> Iterator[Open]:
    """The best suggestion on each axis with a finding, if nothing can be held out that would prove it, and its rivals."""
    nothing_held_out = diagnosis.comparison.held_out == "none"
    named = {c.axis for c in diagnosis.candidates if c.decision == "add"}
    for axis in dict.fromkeys(f.axis for f in diagnosis.comparison.where):
        suggested = [c for c in diagnosis.candidates if c.axis == axis and c.decision == "suggest"]
        best = min(suggested, key=lambda c: c.chance, default=None)
        if best is None or axis in named:
            continue
        if nothing_held_out or best.gain is None:
            yield Open(best.group or (best.effect.id,), axis, REPEAT if nothing_held_out else best.next_measurement)


@dataclass(frozen=True)
class _Plan:
    """The result of the sets of one axis: effects to add to the model, effects to remove from it, and what stays open."""

    lead: Candidate
    new: tuple[Effect, ...]
    removed: tuple[str, ...] = ()
    left: Open | None = None


def _plans(diagnosis: Diagnosis, added: dict[str, list[str]], progress: Progress | None) -> Iterator[_Plan]:
    """The plan of each axis, in the order of its leading candidate; one that is sure leads before one of several."""
    seen: set[str] = set()
    for lead in sorted(diagnosis.candidates, key=lambda c: not c.named):
        if lead.decision != "add" or lead.axis in seen:
            continue
        seen.add(lead.axis)
        if progress is not None:
            progress(f"comparing sets with {lead.effect.id} on {lead.axis}")
        yield _plan(diagnosis, lead, added.get(lead.axis, []))


def _plan(diagnosis: Diagnosis, lead: Candidate, earlier: Sequence[str]) -> _Plan:
    """The best set with the leading candidate, or the leading candidate alone if nothing overlaps with it."""
    if lead.together:
        return _Plan(lead, tuple(base.effects()[i] for i in lead.together))
    alone = _Plan(lead, (lead.effect,)) if len(lead.group) < 2 else _Plan(lead, (), left=_open(diagnosis, lead, lead.group))
    current = Current.of(diagnosis.comparison, lead.axis)
    others = [c for c in diagnosis.candidates if significant(c) and not c.contradicted]
    pool = overlapping(lead, others)
    again = _pool_with(current, lead, pool, earlier)
    reconsidered = [e.id for e in again if e.id in earlier]
    if len(again) == 1:
        return alone
    tested = number_tested(diagnosis.candidates)
    choice = choose(without(current, reconsidered), again, tested)
    stay = {e.id for e in choice.certain} | set(choice.open)
    unsupported = {c.effect.id for c in diagnosis.candidates if c.axis == lead.axis and not c.supported}
    new = tuple(e for e in choice.certain if e.id not in earlier and e.id not in unsupported)
    if not new and (not stay or (lead.named and lead.sure)):
        return alone  # held-out gains alone may leave open, or give to another effect, what the evidence decides
    return _Plan(lead, new, tuple(i for i in reconsidered if i not in stay), _open(diagnosis, lead, choice.open))


def _open(diagnosis: Diagnosis, lead: Candidate, ids: tuple[str, ...]) -> Open | None:
    """Effects that stay open on the axis of a leading candidate, with the measurement that the first of them needs."""
    of_axis = {c.effect.id: c.next_measurement for c in diagnosis.candidates if c.axis == lead.axis}
    return Open(ids, lead.axis, of_axis.get(ids[0]) or lead.next_measurement) if ids else None


def _pool_with(current: Current, lead: Candidate, pool: list[Effect], earlier: Sequence[str]) -> list[Effect]:
    """The pool with the effects of earlier steps that overlap with the leading candidate, if the model is without them."""
    known = [base.effects()[i] for i in earlier if i in base.effects() and not base.effects()[i].fast]
    if not known or lead.effect.fast or lead.signal is None:
        return pool
    stripped = without(current, [e.id for e in known])
    anew = [judge(stripped, e) for e in dict.fromkeys([*pool, *known])]
    near = overlapping(anew[0], anew[1:])
    return near if any(e in known for e in near) else pool


def _taken(
    session: Session, last: Diagnosis, plan: _Plan, refused: set[tuple[str, frozenset[str]]], progress: Progress | None
) -> tuple[Step, Diagnosis] | None:  # fmt: skip
    """Carry out a plan and diagnose again; None if it adds nothing or does not decrease the excess."""
    key = (plan.lead.axis, frozenset(e.id for e in plan.new))
    if not plan.new or key in refused:
        return None
    richer = last.comparison.fit.model
    for effect_id in plan.removed:
        richer = richer.without(effect_id, plan.lead.axis)
    axes = {plan.lead.axis}
    for effect in plan.new:
        proven = {c.axis for c in last.candidates if c.effect.id == effect.id and _alone(c)}
        for axis in sorted({plan.lead.axis} | proven):
            axes.add(axis)
            richer = richer.with_term(Term.of(effect, axis))
    if progress is not None:
        progress(f"adding {', '.join(e.id for e in plan.new)} on {', '.join(sorted(axes))}")
    following = diagnose(session, richer, progress=progress)
    before, after = with_floor_of(last.comparison, following.comparison), following.comparison
    falls = [within for within in (False, True) if _falls(before, after, within)]
    if not falls and (_is_sure(plan) or any(_removed_power(before, after, axis) > 0 for axis in axes)):
        falls = [False]  # so small that it drowns in the noise of the other axes, or below what the held-out likelihood shows
    if not falls:
        refused.add(key)
        return None
    step = Step(tuple(e.id for e in plan.new), tuple(sorted(axes)), plan.removed, before, after, within=falls[0], found=last)
    return step, following


def _is_sure(plan: _Plan) -> bool:
    """True if the diagnosis is sure of the leading effect, and the plan adds it."""
    return plan.lead.named and plan.lead.effect in plan.new


def _without_needless(
    session: Session, step: Step, last: Diagnosis, added: dict[str, list[str]], dropped: set[tuple[str, str]],
    progress: Progress | None,
) -> tuple[Step, Diagnosis]:
    """The step without effects of earlier steps that are no longer significant beside its own, and its diagnosis.

    The first effect of an axis can absorb a part of one that is found later. No effect is dropped twice, so that the steps end.
    """
    tested = number_tested(last.candidates)

    def needless(axis: str, effect_id: str) -> bool:
        effect = base.effects().get(effect_id)
        if effect is None or effect.fast or effect_id in step.removed or (axis, effect_id) in dropped:
            return False
        whole = last.comparison.likeliest.axes[axis]
        rest = without(Current.of(last.comparison, axis), [effect_id]).fit
        chance = likelihood_ratio(rest, whole, max(1, added_parameters(rest, whole)))[1]
        looks = effect.looks([b.run for b in whole.design.blocks], whole.design.axis).shapes
        return looks * chance * tested >= POLICY.name_alarm

    drop = {(axis, i) for axis in step.axes for i in added.get(axis, []) if needless(axis, i)}
    if not drop:
        return step, last
    dropped |= drop
    model = last.comparison.fit.model
    for axis, effect_id in sorted(drop):
        model = model.without(effect_id, axis)
    following = diagnose(session, model, progress=progress)
    removed = (*step.removed, *dict.fromkeys(effect_id for _, effect_id in sorted(drop)))
    return replace(step, removed=removed, after=following.comparison), following


def _alone(c: Candidate) -> bool:
    """True if a candidate is certain by its own evidence, without rivals and without the rest of a set."""
    return c.decision == "add" and len(c.group) < 2 and not c.together


def _over_one_floor(step: Step, final: Comparison) -> Step:
    """The step with its excess over the floor of the final model, so that the steps can be compared with each other.

    A step whose excess does not fall over that floor keeps its own.
    """
    before, after = with_floor_of(step.before, final), with_floor_of(step.after, final)
    same = replace(step, before=before, after=after) if _falls(before, after, step.within) else step
    return replace(same, matters=_matters(step.before, step.after, step.axes, final))


def _falls(before: Comparison, after: Comparison, within: bool) -> bool:
    """True if the held-out excess of all axes is smaller after than before, in all or within power cycles."""
    old, new = _excess(before, within), _excess(after, within)
    return old is not None and new is not None and new < old


def _excess(comparison: Comparison, within: bool) -> float | None:
    """The excess of all axes, deg/s, or that of the net angles, deg; these have none within power cycles."""
    if comparison.angles is not None:
        return comparison.angles.level().excess_deg
    return comparison.pooled.excess_within_dps if within else comparison.pooled.excess_dps


def _matters(before: Comparison, after: Comparison, axes: Sequence[str], final: Comparison) -> bool:
    """True if, on one of its axes, a step removes a noticeable fraction of the squared excess that would otherwise remain."""

    def noticed(axis: str) -> bool:
        removed, left = _removed_power(before, after, axis), final.per_axis[axis].excess_within_dps
        if final.angles is not None:
            left = final.angles.level(axis).excess_deg
        return removed > POLICY.noticeable * (removed + (left or 0.0) ** 2)

    return any(map(noticed, axes))


def _removed_power(before: Comparison, after: Comparison, axis: str) -> float:
    """Decrease of an axis's squared held-out excess, dps^2 (deg^2 by angle), over one floor; 0 if nothing can be held out.

    The offset and scale of a few power cycles can hide the decrease, and so can what a slow effect adds within blocks of 0.1 s.
    The decrease within power cycles, or that of the block means, counts if it is larger.
    """
    if before.angles is not None and after.angles is not None:
        had, has = before.angles.level(axis).rms_deg, after.angles.level(axis).rms_deg
        return 0.0 if had is None or has is None else had**2 - has**2
    old, new = before.per_axis[axis], after.per_axis[axis]
    pairs = (
        (old.rms_dps, new.rms_dps), (old.excess_within_dps, new.excess_within_dps), (old.slow_dps, new.slow_dps)
    )  # fmt: skip
    return max((a**2 - b**2 for a, b in pairs if a is not None and b is not None), default=0.0)
