"""The slow steps of a diagnosis, each computed once for the same session and the same model, and ``add`` without the slowest.

``compare``, ``diagnose``, ``add`` and ``explain`` begin with the same steps, and several tests of a file ask them of the same
session. The steps are functions of session, model and library: equal arguments have equal results. A file whose tests say
nothing of the computation itself, such as its repetition or its progress, takes the fixture ``known_answers``.
"""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields
from typing import Any
from unittest.mock import patch

from gyrocal.diagnosis.answer import compare
from gyrocal.diagnosis.answer.add import Added, add
from gyrocal.diagnosis.naming import candidates as naming
from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.diagnosis.naming.probability import OnAxis, with_probabilities
from gyrocal.diagnosis.residual.comparison import Comparison, measure
from gyrocal.effects.base import effects
from gyrocal.error_model.model import Model
from gyrocal.gravity import compare as gravity_compare
from gyrocal.gravity import naming as gravity_naming
from gyrocal.recording.session import AXES, Session
from gyrocal.variables.base import variables

ON_X, ON_Y, ON_Z = (Model.builtin("default").about(axis) for axis in AXES)
"""The default model of one axis alone. Its diagnosis tries the library on that axis, which costs a third of all three: for
tests that plant on one axis and ask about it, where the others hold noise alone."""


@contextmanager
def without_evidence() -> Iterator[None]:
    """Within this context, a diagnosis is that of the tests alone, without the evidence of sets, which costs a third of it."""

    def none(found: Sequence[Candidate], *_: Any) -> tuple[list[Candidate], list[OnAxis]]:
        return list(found), []

    with patch("gyrocal.diagnosis.answer.diagnose.with_probabilities", none), patch("known.with_probabilities", none):
        yield


@contextmanager
def measured_adds() -> Iterator[None]:
    """Within this context, ``add`` and its command measure what is left and try no other effect on it."""
    with patch("gyrocal.diagnosis.answer.add.compare", compare.measure):
        yield


def add_measured(session: Session, model: Model | None, effect_id: str) -> Added:
    """What ``add`` returns, but that no other effect is tried on what is left.

    The model, the levels and the findings of the residual's own tests are the same. A verdict of these comparisons is not that
    of ``compare``, which the tests of verdicts ask ``add`` itself for.
    """
    with measured_adds():
        return add(session, model, effect_id)


def content(session: Session) -> str:
    """A digest of all that a session holds: its own facts, and the facts and the table of every run."""
    digest = hashlib.sha256()

    def add_fields(of: Any, *without: str) -> None:
        digest.update(repr([(f.name, getattr(of, f.name)) for f in fields(of) if f.name not in without]).encode())

    add_fields(session, "runs")
    for run in session.runs:
        add_fields(run, "frame", "lost")
        digest.update(b"" if run.lost is None else run.lost.tobytes())
        for column in run.table.get_columns():
            digest.update(f"{column.name} {column.null_count()}".encode() + column.to_numpy().tobytes())
    return digest.hexdigest()


def _library() -> tuple[Any, ...]:
    """The effects and variables that a test may have changed."""
    return *effects().items(), *variables().items()


def _known_terms(model: Model) -> tuple[Any, ...] | None:
    """All that a model holds, as a key; None if it holds effects that are not of the library or values of single runs."""
    if any(term.own is not None or term.of_run for term in model.terms):
        return None
    terms = [(t.effect_id, t.axis, repr(t.values), repr(t.se), t.held) for t in model.terms]
    return model.name, *terms, repr([model.noise_on(axis) for axis in AXES]), repr(model.fitted_on)


class _Steps:
    """The steps of one kind of session with the results that they had."""

    def __init__(self, measure: Callable[..., Any], candidates: Callable[..., list[Candidate]]) -> None:
        self._measure, self._candidates = measure, candidates
        self._compared: dict[Any, Any] = {}
        self._judged: dict[Any, Any] = {}

    def measure(self, session: Session, model: Any = None, **options: Any) -> Any:
        of_model = _known_terms(Model.open(model))
        if of_model is None or options.get("about"):
            return self._measure(session, model, **options)
        key = content(session), of_model, options.get("only_day"), _library()
        if key not in self._compared:
            self._compared[key] = self._measure(session, model, **options)
        return self._compared[key]

    def candidates(self, compared: Any, own: Sequence[Any] = (), *, unless: float = 1.0, **options: Any) -> list[Candidate]:
        options |= {} if unless == 1.0 else {"unless": unless}
        if own:
            return self._candidates(compared, own, **options)
        key = id(compared), unless, _library()
        if key not in self._judged:
            self._judged[key] = compared, self._candidates(compared, **options)
        return list(self._judged[key][1])


@contextmanager
def known_answers() -> Iterator[None]:
    """Within this context, what was computed before is not computed again."""
    by_rate, by_gravity = _Steps(measure, naming.candidates), _Steps(gravity_compare.measure, gravity_naming.candidates)
    probabilities: dict[Any, Any] = {}

    def probable(found: Sequence[Candidate], comparison: Comparison, *options: Any) -> Any:
        key = id(comparison.fit), tuple(map(id, found))
        if key not in probabilities:
            probabilities[key] = comparison, found, with_probabilities(found, comparison, *options)
        return probabilities[key][2]

    with (
        patch("gyrocal.diagnosis.answer.diagnose.measure", by_rate.measure),
        patch("gyrocal.diagnosis.answer.compare.measure", by_rate.measure),
        patch("gyrocal.diagnosis.naming.candidates.candidates", by_rate.candidates),
        patch("gyrocal.diagnosis.answer.diagnose.with_probabilities", probable),
        patch("gyrocal.gravity.diagnose.measure", by_gravity.measure),
        patch("gyrocal.gravity.compare.measure", by_gravity.measure),
        patch("gyrocal.gravity.naming.candidates", by_gravity.candidates),
    ):
        yield
