"""The candidates of a diagnosis as the next screens will show them: beside what is named on their axis.

A diagnosis judges a hint beside the model alone. Where an effect is named on the axis, the hint is judged again with that
effect in the model, so that it is no other description of the same course. And it counts what a candidate explains over the
noise that this candidate leaves, which takes what the others on the axis explain for noise: each then explains all. Here it
is counted over the noise that all of them leave, as after they are added.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gyrocal.diagnosis.answer.diagnose import Diagnosis
from gyrocal.diagnosis.naming.candidate import Candidate, number_tested
from gyrocal.diagnosis.naming.judge import judge
from gyrocal.diagnosis.naming.standing_model import Current
from gyrocal.diagnosis.residual.comparison import Comparison
from gyrocal.diagnosis.residual.levels import Level, explained
from gyrocal.policy import POLICY

ORDER = {"add": 1, "suggest": 2, "reject": 3, "not_measurable": 4}


def as_shown(found: Diagnosis) -> list[Candidate]:
    """The candidates: those that are sure by themselves first, then those of which one acts, then hints."""
    out = list(found.candidates)
    tested = number_tested(out)
    for axis in found.comparison.judged:
        changed = _on_axis([c for c in out if c.axis == axis], found.comparison, axis, tested)
        out = [changed.get(c.effect.id, c) if c.axis == axis else c for c in out]
    return sorted(out, key=lambda c: 0 if c.named else ORDER[c.decision])


def sure_ones(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Of the candidates of one axis, those that are sure by themselves, and those that are sure beside these."""
    alone = {c.effect.id for c in candidates if c.named and not c.together}
    return [c for c in candidates if c.named and (not c.together or alone & set(c.together))]


def _on_axis(candidates: Sequence[Candidate], comparison: Comparison, axis: str, tested: int) -> dict[str, Candidate]:
    """The candidates that change on one axis, by the ids of their effects."""
    sure = sure_ones(candidates)
    several = [c for c in candidates if c.decision == "add" and len(c.group) > 1]
    hints = [c for c in candidates if c.decision == "suggest" and not c.together]
    changed: dict[str, Candidate] = {}
    if not sure or not (hints or len(sure) > 1 or several):
        return changed
    alone = Current.of(comparison, axis)
    richest = alone
    for c in sure:
        richest = richest.with_effect(c.effect, c.values)
    for c in hints:
        changed[c.effect.id] = _beside(richest, c, tested)
    if len(sure) > 1 or several:
        changed |= _of_all(alone, richest, sure, several)
    return changed


def _beside(richest: Current, hint: Candidate, tested: int) -> Candidate:
    """A hint with its evidence beside what is named; one that noise explains there was looked for and not found."""
    again = judge(richest, hint.effect)
    q_value = min(1.0, again.chance * tested)
    kept = again.decision != "not_measurable" and not again.contradicted and q_value < POLICY.false_discovery_rate
    return replace(
        again, decision="suggest" if kept else "reject", q_value=q_value, group=hint.group if kept else (),
        next_measurement=hint.next_measurement, log_odds=hint.log_odds, checks=hint.checks,
    )  # fmt: skip


def _of_all(
    alone: Current, richest: Current, sure: Sequence[Candidate], several: Sequence[Candidate]
) -> dict[str, Candidate]:  # fmt: skip
    """The named candidates with the part of the excess that each explains over the noise that all of them leave."""
    everything, groups = richest, set[tuple[str, ...]]()
    for c in several:
        if tuple(sorted(c.group)) not in groups:
            groups.add(tuple(sorted(c.group)))
            everything = everything.with_effect(c.effect, c.values)
    if not alone.folds:
        return {}
    floor, cycles = everything.floor_of(everything.fit), alone.comparison.cycles
    before = Level.of(alone.squares, floor)
    changed = {}
    for c in (*sure, *several):
        if c.effect.fast or c.effect.fault_of(c.values) is not None:
            continue  # it was fitted to samples, and its rivals cannot take it for noise
        after = Level.of(alone.squares_of(alone.with_effect(c.effect, c.values).fit), floor)
        changed[c.effect.id] = replace(c, explained=explained(before, after, cycles))
    return changed
