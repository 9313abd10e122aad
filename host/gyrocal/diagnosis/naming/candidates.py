"""Judge every effect that a model does not have, on every axis, and find those that can be named."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from gyrocal import tails
from gyrocal.diagnosis.naming.beside import as_sets, beside_better, excludes
from gyrocal.diagnosis.naming.candidate import Candidate, best_first
from gyrocal.diagnosis.naming.decision import decide, with_q_values, without_unphysical
from gyrocal.diagnosis.naming.judge import judge, not_measurable, without_mean
from gyrocal.diagnosis.naming.one_clock import refuted
from gyrocal.diagnosis.naming.rivals import with_groups, with_suggested_groups
from gyrocal.diagnosis.naming.standing_model import Current
from gyrocal.diagnosis.residual.comparison import Comparison, beside_named
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.effects import base
from gyrocal.effects.base import Effect
from gyrocal.error_model.term import Term
from gyrocal.inference.registering import symmetric
from gyrocal.threads import each
from gyrocal.units import rate_text
from gyrocal.variables.rate import Rate
from gyrocal.variables.reading import Reading

Progress = Callable[[str], None]


def candidates(
    comparison: Comparison, own: Sequence[Effect] = (), *, unless: float = 1.0, progress: Progress | None = None
) -> list[Candidate]:
    """Every effect of the library and every one of ``own`` that the model lacks, judged and decided, best first.

    Those that noise explains with a probability above ``unless`` have no held-out evidence.
    """

    def on(axis: str) -> list[Candidate]:
        return _on_axis(Current.of(comparison, axis), own, unless, progress)

    judged = list(chain.from_iterable(each(on, comparison.judged, comparison.fit.session.rows)))
    decided = decide(with_q_values(judged), comparison)
    grouped = with_groups(decided, lambda c, rival: excludes(c, rival, comparison))
    alone = beside_better(grouped, comparison)
    judged = as_sets(alone, comparison)
    wrong = refuted(judged)
    if wrong:
        kept = [_contradicted(c) if (c.effect.id, c.axis) in wrong else c for c in alone]
        judged = as_sets(kept, comparison)
    judged = [_unproven(c) if c.axis in comparison.unsure else c for c in _symmetric(judged, comparison)]
    unnamed = {f.axis for f in comparison.where} - {c.axis for c in judged if c.decision == "add"}
    return sorted(with_suggested_groups(without_unphysical(judged), unnamed), key=best_first)


def with_named(comparison: Comparison, judged: Sequence[Candidate], only_day: int | None = None) -> Comparison:
    """A comparison whose own tests find nothing, with the named effects as findings and the noise that is left beside them.

    The likeliest noise holds what such an effect makes, so that there would be no excess over it. Of effects that nothing tells
    apart, the first counts. A fault of the reading, and what block means do not show, is in the scatter within blocks instead.
    """
    beside: dict[str, Current] = {}
    for c in judged:
        slow = c.decision == "add" and not c.effect.fast and c.effect.fault_of(c.values) is None
        if slow and (c.named or c.axis not in beside):
            beside[c.axis] = (beside.get(c.axis) or Current.of(comparison, c.axis)).with_effect(c.effect, c.values)
    clean = {axis: current.fit for axis, current in beside.items()}
    told = beside_named(comparison, clean, only_day) if clean else comparison
    return replace(told, where=findings(comparison, judged))


def findings(comparison: Comparison, judged: Sequence[Candidate]) -> list[Finding]:
    """The candidates with decision ``add`` as findings, each against the variable that fits best on its axis."""
    out = []
    for c in judged:
        if c.decision != "add":
            continue
        nearest = comparison.nearest.get(c.axis)
        strength = float(np.sqrt(tails.chi_square_value(max(c.chance, 1e-300), 1)))
        blocks = sum(len(b.run) for b in comparison.fit.blocks)
        amplitude = 0.0 if c.signal is None else float(np.sqrt(2 * np.nansum(c.signal**2) / blocks))
        note = f"rms {rate_text(amplitude / np.sqrt(2))}, in the shape of: {c.effect.title.lower()}"
        against, shape = (Rate.name, None) if nearest is None else (nearest.against, nearest.shape)
        if c.effect.shown_against:
            against, shape = c.effect.shown_against, None
        if c.effect.fault_of(c.values):
            against, shape, note = Reading.name, None, c.effect.title.lower()
        out.append(Finding(c.axis, against, strength, c.chance, amplitude, note, shape))
    return sorted(out, key=lambda f: -f.strength)


def _unproven(c: Candidate) -> Candidate:
    """The candidate, whose evidence may come from a run that a warning accuses."""
    return replace(c, decision="suggest", group=()) if c.decision == "add" else c


def _contradicted(c: Candidate) -> Candidate:
    """The candidate, which another axis contradicts."""
    return replace(c, decision="suggest" if c.decision == "add" else c.decision, group=(), enough=False, contradicted=True)


def _symmetric(judged: Sequence[Candidate], comparison: Comparison) -> list[Candidate]:
    """The candidates with the misalignment against a three-axis reference as a fit of the model with it on both axes has it.

    Each was fitted at the alignment of the model without misalignment, where the two of a pair differ by a rotation. One of a
    rotation alone, which leaves nothing that differs from zero, is not to be added.
    """
    if not comparison.fit.session.three_axes:
        return list(judged)
    terms = {(c.effect.id, c.axis): replace(Term.of(c.effect, c.axis, c.values), se=c.se) for c in judged if c.values}
    found = symmetric(terms)
    out = []
    for c in judged:
        term = found.get((c.effect.id, c.axis))
        if term is not None and term.values != c.values:
            c = replace(c, values=term.values, se=term.se)
            if c.decision == "add" and without_mean(term):
                c = replace(c, decision="suggest", group=())
        out.append(c)
    return out


def _on_axis(current: Current, own: Sequence[Effect], unless: float, progress: Progress | None) -> list[Candidate]:
    """Judge every effect that the model does not have on one axis."""
    present = {t.effect_id for t in current.fit.terms}
    out = []
    for effect in [*base.effects().values(), *own]:
        if effect.id in present or effect.role is not None:
            continue
        if progress is not None:
            progress(f"trying {effect.id} on {current.axis}")
        lacking = effect.missing(current.comparison.fit.session.about(current.axis).runs, current.index)
        if lacking is not None:
            out.append(not_measurable(current, effect, lacking))
        else:
            out.append(judge(current, effect, unless))
    return out
