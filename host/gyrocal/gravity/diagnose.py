"""Diagnosis by the angles of movements and the readings at rest: the missing effect, adding it, and adding all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gyrocal.diagnosis.answer.add import lacking_axes, only_axis
from gyrocal.diagnosis.answer.diagnose import verdict_on
from gyrocal.diagnosis.answer.explain import Concluded
from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.diagnosis.naming.decision import proven
from gyrocal.diagnosis.residual.judged import on_axis
from gyrocal.effects.base import effects
from gyrocal.error_model.formula import effect_or_formula
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.gravity import naming
from gyrocal.gravity.compare import Comparison, compare, findings, measure
from gyrocal.gravity.fit import why_invisible
from gyrocal.noise.axis import COMPONENTS
from gyrocal.policy import POLICY
from gyrocal.recording.session import Session
from gyrocal.shown import Shown


@dataclass(frozen=True, repr=False, eq=False)
class Diagnosis(Shown):
    """The candidates, best first, and the verdict: add, ambiguous, unknown, adequate or implausible."""

    verdict: str
    candidates: list[Candidate]
    comparison: Comparison = field(repr=False)

    @property
    def best(self) -> Candidate | None:
        """The first candidate that may be added, or None."""
        return next((c for c in self.candidates if c.decision == "add"), None)

    @property
    def unknown(self) -> dict[str, Any] | None:
        """Axis, variable, shape and amplitude (deg) of a misfit that no effect explains; None for other verdicts."""
        if self.verdict != "unknown":
            return None
        first = self.comparison.where[0]
        return {"axis": first.axis, "against": first.against, "shape": first.note, "amplitude_deg": first.amplitude_dps}

    def on(self, axis: str) -> Diagnosis:
        """The diagnosis of one axis alone."""
        comparison, candidates = self.comparison.on(axis), on_axis(self.candidates, axis)
        return Diagnosis(verdict_on(comparison, candidates), candidates, comparison)

    def to_json(self) -> dict[str, Any]:
        return {
            "verdict": self.verdict, "residual": "angle", "candidates": [candidate_json(c) for c in self.candidates],
            "unknown": self.unknown, "alternatives": [], "warnings": [w.to_json() for w in self.comparison.warnings],
        }  # fmt: skip


def candidate_json(c: Candidate) -> dict[str, Any]:
    """A candidate as ``diagnose`` prints it, its excess in deg."""
    told = c.to_json()
    told["excess_drop_deg"] = told.pop("excess_drop_dps")
    del told["excess_drop_se_dps"]
    return told


def diagnose(session: Session, model: Model | str | Path | None = None, formulas: Sequence[str] = ()) -> Diagnosis:
    """Rank every effect of the library and every formula, on every axis. Raises InputError as ``compare`` does."""
    comparison = measure(session, model)
    judged = naming.candidates(comparison.evidence, [effect_or_formula(text) for text in formulas])
    if not comparison.where and not comparison.implausible:
        comparison = replace(comparison, where=findings(comparison, judged))
    if comparison.implausible:
        judged = [replace(c, decision="suggest") if c.decision == "add" else c for c in judged]
    return Diagnosis(verdict_on(comparison, judged), judged, comparison)


class Added(NamedTuple):
    """Both comparisons over the same floor, and the model with its parameters fitted to all data."""

    before: Comparison
    after: Comparison

    @property
    def model(self) -> Model:
        """The model with the effect, fitted."""
        return self.after.fit.model


def over_floor_of(before: Comparison, after: Comparison) -> Comparison:
    """The poorer model's comparison with the floor of the richer one."""
    everything = np.arange(len(before.fit.scene.movements))
    return replace(before, pooled=before.evidence.before.level(everything, after.evidence.before))


def add(session: Session, model: Model | str | Path | None, effect_id: str, *, axis: str | None = None) -> Added:
    """Add an effect on the axes where it is proven, or on that with the largest gain; with ``axis``, on this one alone.

    Raises InputError for an unknown id, and for an effect that the model has already.
    """
    start = Model.open(model)
    axes = lacking_axes(start, effect_id if effect_id in COMPONENTS else effect_or_formula(effect_id).id, start.axes)
    axes = only_axis(axes, axis)
    before = compare(session, start)
    if effect_id in COMPONENTS:
        richer = start
        for each in start.axes if axis is None else [axis]:
            richer = richer.add(effect_id, each)
        return Added(before, compare(session, richer))
    effect = effect_or_formula(effect_id)
    judged = [before.evidence.judge(effect, each) for each in axes]
    seen = [c for c in judged if c.decision != "not_measurable"]
    looks = len(effects()) * max(len(seen), 1)
    chosen = [c for c in seen if proven(c, looks)] or sorted(seen, key=lambda c: c.chance)[:1]
    if not chosen:
        why = why_invisible(Term.of(effect, axes[0]), before.fit.scene)
        before = replace(before, note=f"{effect.id} was not added: {why}")
    richer = start
    for c in chosen:
        richer = richer.with_term(Term.of(effect, c.axis, effect.structure(c.values)))
    after = compare(session, richer)
    return Added(over_floor_of(before, after), after)


@dataclass(frozen=True)
class Step:
    """An effect that was added on some axes, with the comparisons before and after over the same floor."""

    effects: tuple[str, ...]
    axes: tuple[str, ...]
    before: Comparison = field(repr=False)
    after: Comparison = field(repr=False)

    @property
    def matters(self) -> bool:
        """True if the step removes a noticeable part of the squared error."""
        old, new = self.before.pooled, self.after.pooled
        if old.rms_deg is None or new.rms_deg is None:
            return True
        removed = old.rms_deg**2 - new.rms_deg**2
        return removed > POLICY.noticeable * (removed + (new.excess_deg or 0.0) ** 2)

    def to_json(self) -> dict[str, Any]:
        return {
            "effects": list(self.effects), "axes": list(self.axes), "excess_before_deg": self.before.pooled.excess_deg,
            "excess_after_deg": self.after.pooled.excess_deg, "matters": self.matters,
        }  # fmt: skip


@dataclass(frozen=True, repr=False, eq=False)
class Explanation(Concluded, Shown):
    """The steps, the candidates that cannot be distinguished, and the diagnosis of the final model."""

    steps: list[Step]
    left: list[Candidate]
    last: Diagnosis = field(repr=False)

    def to_json(self) -> dict[str, Any]:
        told = self.last.comparison.to_json()
        return {
            "steps": [s.to_json() for s in self.steps], "residual": "angle",
            "left": [{"group": list(c.group), "axis": c.axis, "next_measurement": c.next_measurement} for c in self.left],
            "verdict": self.verdict, "model": self.model.ids, "parameters": told["parameters"], "unknown": self.last.unknown,
            "warnings": told["warnings"],
        }  # fmt: skip


def explain(
    session: Session, model: Model | str | Path | None = None, most_steps: int = POLICY.most_steps
) -> Explanation:
    """Add effects as long as one is certain. Raises InputError as ``compare`` does, and for a negative ``most_steps``."""
    if most_steps < 0:
        raise InputError(f"--max is {most_steps}; give the largest number of steps, 0 or more")
    last = diagnose(session, model)
    steps: list[Step] = []
    while len(steps) < most_steps and last.verdict in ("add", "ambiguous"):
        sure = [c for c in last.candidates if c.decision == "add" and len(c.group) < 2]
        if not sure:
            break
        lead = sure[0].effect
        same = [c for c in sure if c.effect.id == lead.id]
        richer = last.comparison.fit.model
        for c in same:
            richer = richer.with_term(Term.of(lead, c.axis, lead.structure(c.values)))
        following = diagnose(session, richer)
        before = over_floor_of(last.comparison, following.comparison)
        steps.append(Step((lead.id,), tuple(c.axis for c in same), before, following.comparison))
        last = following
    left = [c for c in last.candidates if c.decision == "add" and len(c.group) > 1]
    return Explanation(steps, left, last)
