"""What a method answered, and what is right for a case."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from itertools import product
from typing import Any

import numpy as np

from .generator.case import Case, Effect

LEAST_DETECTABILITY = 8.0
"""In standard errors: the aims hold for what the data can tell."""
NAMEABLE = ("effect", "pair", "set")
"""Kinds of cases whose effects can be named, and added one by one."""

Name = tuple[str, str]  # effect and axis


@dataclass(frozen=True)
class Answer:
    """What one method said of a session.

    `named` in the order found, `group` what is shown with the first, `decisions` on each planted effect where it sits,
    `error_dps` what is left when all that was named has been added (the function below), None where it was not asked.
    """

    verdict: str
    named: tuple[Name, ...] = ()
    group: tuple[str, ...] = ()
    decisions: tuple[str, ...] = ()
    error_dps: float | None = None


@dataclass(frozen=True)
class Outcome:
    """One case: what each method answered, and in words what the tool saw."""

    case: Case
    detectability: float
    answers: dict[str, Answer]
    note: str = ""

    @property
    def counts(self) -> bool:
        """Can the data tell? What is confounded is hidden by design, and a null has nothing to detect."""
        return self.case.kind in ("null", "confounded") or self.detectability >= LEAST_DETECTABILITY

    @property
    def planted(self) -> set[Name]:
        """Every right name; what sits on several axes may be named on any of them."""
        return {(e.id, axis) for e in self.case.effects for axis in e.axes if e.id in self.case.expected}

    def right(self, method: str) -> bool:
        """Was the first answer the right one for this kind of case?"""
        answer = self.answers[method]
        if self.case.kind == "null":
            return answer.verdict == "adequate"
        if self.case.kind == "unknown":
            return answer.verdict == "unknown"
        if self.case.kind == "confounded":
            return self._declared(answer)
        return bool(answer.named) and answer.named[0] in self.planted

    def in_group(self, method: str) -> bool:
        """Is a planted effect among those shown, on an axis that shows it?"""
        answer = self.answers[method]
        return bool(answer.named) and any((id_, answer.named[0][1]) in self.planted for id_ in answer.group)

    def misnamed(self, method: str) -> bool:
        """One cause was stated, and it is not there; of a set, any of those that were added."""
        answer = self.answers[method]
        if self.case.kind == "set":
            return any(name not in self.planted for name in answer.named)
        return answer.verdict == "add" and answer.named[0] not in self.planted

    def completed(self, method: str) -> bool:
        """All that was planted was found one by one, and nothing more."""
        each_once = product(*([(e.id, axis) for axis in e.axes] for e in self.case.effects))
        return sorted(self.answers[method].named) in [sorted(names) for names in each_once]

    def found(self, method: str) -> float:
        """The share of the planted effects that were named."""
        named = set(self.answers[method].named)
        return float(np.mean([any((e.id, axis) in named for axis in e.axes) for e in self.case.effects]))

    @property
    def fitted(self) -> bool:
        """Has the oracle an error, to hold the others against?"""
        return "oracle" in self.answers and self.answers["oracle"].error_dps is not None

    def _declared(self, answer: Answer) -> bool:
        """Said to be not measurable here, or shown in a group with what looks alike."""
        if answer.verdict == "add":
            return False
        with_rival = set(answer.group) >= set(self.case.expected) and bool(set(answer.group) & set(self.case.rivals))
        return with_rival or set(answer.decisions) == {"not_measurable"}

    @property
    def fault(self) -> str | None:
        """What is wrong with the tool's answer; None if nothing."""
        if not self.right("gyrocal") or self.misnamed("gyrocal"):
            return "misnamed" if self.misnamed("gyrocal") else "wrong"
        if self.case.kind in NAMEABLE and not self.completed("gyrocal"):
            return "not completed"
        return None

    def line(self) -> str:
        """One line for a list of failures."""
        case, said = self.case, self.answers["gyrocal"]
        planted = ", ".join(f"{e.id} on {e.axes} ({_sizes(e)})" for e in case.effects) or "nothing"
        rivals = f", alike: {'/'.join(case.rivals)}" if case.rivals else ""
        named = ", then ".join(f"{id_} on {axis}" for id_, axis in said.named) or "nothing"
        group = f" in group {'/'.join(said.group)}" if len(said.group) > 1 else ""
        return (
            f"{case.name}: planted {planted}{rivals}; verdict {said.verdict}, named {named}{group} "
            f"(seed {case.seed}, {case.protocol}, {case.poll_hz:g} Hz, table {case.table_axis}, "
            f"detectability {self.detectability:.1f}; {self.note})"
        )

    def to_row(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_row(cls, row: Mapping[str, Any]) -> Outcome:
        case = dict(row["case"])
        effects = tuple(Effect(**effect) for effect in case.pop("effects"))
        case = Case(**_tuples(case), effects=effects)
        answers = {
            method: Answer(**{**_tuples(answer), "named": tuple(map(tuple, answer["named"]))})
            for method, answer in row["answers"].items()
        }
        return cls(case, row["detectability"], answers, row["note"])


def _sizes(effect: Effect) -> str:
    return ", ".join(f"{name} {value:.3g}" for name, value in effect.parameters.items())


def _tuples(row: Mapping[str, Any]) -> dict[str, Any]:
    """JSON has lists alone."""
    return {key: tuple(value) if isinstance(value, list) else value for key, value in row.items()}
