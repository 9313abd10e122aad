"""Diagnose which physical effect a model is missing, with evidence from held-out data.

There are two levels of evidence. An effect is *suggested* if it improves the fit significantly, judged by the false-discovery
rate over all candidates (Benjamini and Hochberg). It is to be *added* if it also predicts held-out runs significantly better,
its parameters are in physical range, it explains enough of the excess error, and the evidence of sets of effects beside an
unnamed rest supports it. Candidates whose signals overlap in this session form a group. For a group, the diagnosis names the
measurement that separates its members instead of a cause. The thresholds are in ``gyrocal/policy``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

from gyrocal.diagnosis.naming import candidates as naming
from gyrocal.diagnosis.naming.beside import beside_sure, with_values_together
from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.diagnosis.naming.probability import OnAxis, decided, improbable_noise, told_sets, with_probabilities
from gyrocal.diagnosis.residual.comparison import Comparison, measure
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.diagnosis.residual.judged import on_axis
from gyrocal.error_model.formula import effect_or_formula
from gyrocal.error_model.model import Model
from gyrocal.recording.session import Session
from gyrocal.shown import Shown
from gyrocal.threads import one_thread
from gyrocal.variables.reading import Reading

Progress = Callable[[str], None]


@dataclass(frozen=True, repr=False, eq=False)
class Diagnosis(Shown):
    """The candidates, best first, and the verdict: add, ambiguous, unknown, adequate or implausible."""

    verdict: str
    candidates: list[Candidate]
    unknown: dict[str, Any] | None
    comparison: Comparison = field(repr=False)
    alternatives: list[OnAxis] = field(default_factory=list, repr=False)
    """The sets of effects that explain an axis together, the most probable first on each axis."""
    tested: list[Candidate] = field(default_factory=list, repr=False)
    """The candidates as the tests decide on them, without the evidence of sets."""

    @property
    def best(self) -> Candidate | None:
        """The first candidate that may be added, a sure one before those that cannot be told apart, or None."""
        return next((c for c in self.candidates if c.decision == "add"), None)

    def on(self, axis: str) -> Diagnosis:
        """The diagnosis of one axis alone. Raises InputError if the model does not cover it."""
        comparison, candidates = self.comparison.on(axis), on_axis(self.candidates, axis)
        verdict = verdict_on(comparison, candidates)
        unknown = _unknown(comparison) if verdict == "unknown" else None
        alternatives, tested = on_axis(self.alternatives, axis), on_axis(self.tested, axis)
        return Diagnosis(verdict, candidates, unknown, comparison, alternatives, tested)

    def to_json(self) -> dict[str, Any]:
        return {
            "verdict": self.verdict, "residual": "rate" if self.comparison.angles is None else "angle",
            "candidates": [c.to_json() for c in self.candidates], "unknown": self.unknown,
            "alternatives": [a.to_json() for a in self.alternatives],
            "warnings": [w.to_json() for w in self.comparison.warnings],
        }  # fmt: skip


@one_thread
def diagnose(
    session: Session,
    model: Model | str | Path | None = None,
    *,
    formulas: Sequence[str] = (),
    progress: Progress | None = None,
) -> Diagnosis:
    """Rank every effect of the library and every given formula, on every axis, as the effect that the model is missing.

    Raises InputError for a model that :func:`gyrocal.diagnosis.answer.compare.compare` refuses and for a formula that cannot be
    parsed.
    """
    own = [effect_or_formula(text) for text in formulas]
    comparison = measure(session, model, progress=progress)
    judged = naming.candidates(comparison, own, progress=progress)
    if not comparison.where and not comparison.implausible:
        comparison = naming.with_named(comparison, judged)
    tested, alternatives = with_probabilities(judged, comparison, progress)
    judged = decided(tested, _failing(comparison), lambda sure, others: beside_sure(sure, others, comparison))
    judged = with_values_together(judged, comparison)
    verdict = verdict_on(comparison, judged)
    if verdict == "adequate":
        comparison = replace(comparison, where=improbable_noise(alternatives, comparison))
        verdict = verdict_on(comparison, judged)
    unknown = _unknown(comparison) if verdict == "unknown" else None
    return Diagnosis(verdict, judged, unknown, comparison, told_sets(alternatives, judged), tested)


def _failing(comparison: Comparison) -> set[str]:
    """The axes on which something fails that a slow effect may explain: no fault of the reading, no line or band above it.

    What fails on an axis on which nothing is sure has no name.
    """
    return {f.axis for f in comparison.where if not f.above_blocks and f.against != Reading.name} - comparison.unsure


class Compared(Protocol):
    """What a comparison says of its model, whether it is judged by rates or by angles."""

    @property
    def implausible(self) -> bool:
        """True if a blocking warning applies to the session's own axis."""

    @property
    def where(self) -> Sequence[Finding]:
        """The findings."""


def verdict_on(comparison: Compared, judged: Sequence[Candidate]) -> str:
    """The verdict on candidates that are sorted best first."""
    if comparison.implausible:
        return "implausible"
    if judged and judged[0].decision == "add":
        return "add" if judged[0].named else "ambiguous"
    return "unknown" if comparison.where else "adequate"


def _unknown(comparison: Comparison) -> dict[str, Any]:
    """The strongest finding as a description of a misfit that no effect explains."""
    first = comparison.where[0]
    return {"axis": first.axis, "against": first.against, "shape": first.note, "amplitude_dps": first.amplitude_dps}
