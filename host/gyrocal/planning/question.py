"""The question that a plan answers: which of several effects acts, or how large one is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from gyrocal.diagnosis.answer.diagnose import Diagnosis
from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.diagnosis.naming.standing_model import Current
from gyrocal.effects import base
from gyrocal.effects.base import Effect
from gyrocal.effects.timing import TimingEffect
from gyrocal.errors import InputError
from gyrocal.planning.columns import Member, member_of


@dataclass(frozen=True)
class Question:
    """``tell_apart``: which of the effects acts on the axis. ``measure``: how large the one effect is."""

    kind: Literal["tell_apart", "measure"]
    effects: tuple[str, ...]
    axis: str
    why: str
    """Where the question comes from, as a sentence."""

    def to_json(self) -> dict[str, Any]:
        return {"kind": self.kind, "effects": list(self.effects), "axis": self.axis}

    def members(self, diagnosis: Diagnosis) -> list[Member]:
        """The effects in question with the sizes that the session gives them."""
        current = Current.of(diagnosis.comparison, self.axis)
        found = {c.effect.id: c for c in diagnosis.candidates if c.axis == self.axis}
        members = []
        for effect_id in self.effects:
            candidate = found.get(effect_id)
            values = candidate.values if candidate is not None and candidate.decision != "not_measurable" else {}
            members.append(member_of(current, _effect(effect_id, diagnosis), values))
        return members


def check_one_question(between: Sequence[str], measure: str | None) -> None:
    """Raise InputError unless the words of a question ask one, or none."""
    if between and measure is not None:
        raise InputError("--between and --measure ask two questions; give one of them")
    if len(set(between)) == 1:
        raise InputError(f"--between {','.join(between)}: give two different effects, ID,ID")


def ask(diagnosis: Diagnosis, between: Sequence[str] = (), measure: str | None = None) -> Question:
    """The question that was asked, or else the most urgent one of a diagnosis. Raises InputError if there is none."""
    if between:
        return _between(diagnosis, between)
    if measure is not None:
        kind = _effect(measure, diagnosis)
        _check(kind)
        return Question("measure", (kind.id,), _axis(diagnosis, (kind.id,)), f"The size of {kind.id} was asked for.")
    return _open(diagnosis)


def _between(diagnosis: Diagnosis, between: Sequence[str]) -> Question:
    kinds = [_effect(name, diagnosis) for name in between]
    ids = tuple(dict.fromkeys(kind.id for kind in kinds))
    for kind in kinds:
        _check(kind)
        if any(t.effect_id == kind.id for t in diagnosis.comparison.fit.model.terms):
            text = f"--between {','.join(between)}: {kind.id} is in the model"
            raise InputError(f"{text}; give a model without it, or ask for its size by --measure {kind.id}")
    return Question("tell_apart", ids, _axis(diagnosis, ids), f"Which of {' and '.join(ids)} acts was asked for.")


def _open(diagnosis: Diagnosis) -> Question:
    """The group of an ambiguous verdict, else a suggestion, else the parameter that is known worst."""
    best = diagnosis.best
    if diagnosis.verdict == "ambiguous" and best is not None:
        ids = tuple(i for i in best.group if _plannable(_effect(i, diagnosis)))
        if len(ids) > 1:
            return Question("tell_apart", ids, best.axis, f"The session cannot tell which of {', '.join(ids)} acts.")
    suggested = [c for c in diagnosis.candidates if c.decision == "suggest" and c.values and _plannable(c.effect)]
    if suggested and diagnosis.verdict != "add":
        c = suggested[0]
        return Question("measure", (c.effect.id,), c.axis, f"The session suggests {c.effect.id}, but does not prove it.")
    worst = _worst_known(diagnosis)
    if worst is not None:
        effect_id, axis, ratio = worst
        return Question(
            "measure", (effect_id,), axis,
            f"Nothing is open. Of the model's effects, {effect_id} is known worst: its error is {ratio:.2g} of its size.",
        )  # fmt: skip
    raise InputError("plan: nothing is open in this session; ask a question by --between ID,ID or --measure ID")


def _worst_known(diagnosis: Diagnosis) -> tuple[str, str, float] | None:
    """Effect, axis and relative standard error of the parameter that is largest of all in the model on the session's axis."""
    session = diagnosis.comparison.fit.session
    found = [
        (abs(term.se[name] / term.values[name]), term.effect_id, term.axis)
        for term in diagnosis.comparison.fit.model.terms
        for name in term.effect.coding.used(term.values)
        if term.axis == session.axis and _plannable(term.effect) and term.se.get(name) and term.values.get(name)
    ]
    if not found:
        return None
    ratio, effect_id, axis = max(found)
    return effect_id, axis, ratio


def _axis(diagnosis: Diagnosis, ids: Sequence[str]) -> str:
    """The axis on which the session says most of these effects, else its own."""
    def strength(c: Candidate) -> float:
        return c.gain if c.gain is not None else 0.0

    seen = [c for c in diagnosis.candidates if c.effect.id in ids and c.decision in ("add", "suggest")]
    return max(seen, key=strength).axis if seen else diagnosis.comparison.fit.session.axis


def _effect(effect_id: str, diagnosis: Diagnosis) -> Effect:
    """An effect by id: one of the diagnosis or of the model, which may be a user's own, else one of the library."""
    own = [c.effect for c in diagnosis.candidates] + [t.effect for t in diagnosis.comparison.fit.model.terms]
    return next((kind for kind in own if kind.id == effect_id), None) or base.effect(effect_id)


def _plannable(effect: Effect) -> bool:
    return not isinstance(effect, TimingEffect) and effect.fault is None and not effect.fast


def _check(effect: Effect) -> None:
    if not _plannable(effect):
        raise InputError(
            f"plan: {effect.id} changes single readings or their timing, which no power cycle of a plan shows better than "
            f"another; to see more of it: {effect.measure_next}"
        )
