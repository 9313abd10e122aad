"""Add an effect to a model and compare the error before and after."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import reduce
from pathlib import Path
from typing import NamedTuple

from gyrocal.diagnosis.candidate import Candidate
from gyrocal.diagnosis.compare import compare
from gyrocal.diagnosis.comparison import Comparison, with_floor_of
from gyrocal.diagnosis.current import Current
from gyrocal.diagnosis.decision import proven
from gyrocal.diagnosis.evidence import judge
from gyrocal.effects import base
from gyrocal.effects.base import Effect
from gyrocal.error_model.formula import effect_or_formula
from gyrocal.error_model.model import Model, Term
from gyrocal.noise.axis import COMPONENTS
from gyrocal.recording.session import AXES, Session
from gyrocal.threads import each, one_thread

Progress = Callable[[str], None]


class Added(NamedTuple):
    """The result of :func:`add`.

    Both comparisons use held-out data and the same noise floor. The parameters of ``model`` are fitted to all data.
    """

    before: Comparison
    after: Comparison
    model: Model


def effect_named(effect_id: str) -> Effect | None:
    """The effect or formula of this name; None for a component of the noise. Raises InputError if it is none of these."""
    return None if effect_id in COMPONENTS else effect_or_formula(effect_id)


@one_thread
def add(
    session: Session, model: Model | str | Path | None, effect_id: str, *, only_day: int | None = None,
    progress: Progress | None = None,
) -> Added:  # fmt: skip
    """Add an effect on every axis where it can be measured and improves the fit.

    ``effect_id`` is the id of an effect, the id of a noise component, or a formula. A noise component is added on every axis
    of the model. Where no axis proves the effect, ``add`` uses the axis with the largest gain and explains this in
    ``before.note``. ``only_day`` restricts the held-out data to one day. Raises InputError for an unknown id, a formula that
    cannot be parsed, or a day that cannot be left out.
    """
    effect = effect_named(effect_id)
    start = Model.open(model)
    before = compare(session, start, only_day=only_day, progress=progress)
    if effect is None:
        noisier = reduce(lambda grown, axis: grown.add(effect_id, axis), start.axes, start)
        after = compare(session, noisier, only_day=only_day, progress=progress)
        return Added(with_floor_of(before, after), after, after.fit.model)
    axes = [
        a for a in before.fit.axes
        if start.term(effect.id, a) is None and effect.missing(session.about(a).runs, AXES.index(a)) is None
    ]  # fmt: skip

    def on(axis: str) -> Candidate:
        return judge(Current.of(before, axis), effect)

    judged = dict(zip(axes, each(on, axes, session.rows), strict=True))
    chosen = _chosen(judged)
    if not chosen:
        before = replace(before, note=f"{effect.id} was not added: {_reason(session, start, effect, list(before.fit.axes))}")
    richer = start
    for axis in chosen:
        richer = richer.with_term(Term.of(effect, axis, effect.structure(judged[axis].values)))
    after = compare(session, richer, only_day=only_day, progress=progress)
    return Added(with_floor_of(before, after), after, after.fit.model)


def _chosen(judged: dict[str, Candidate]) -> list[str]:
    """The axes on which the effect is proven, or else the axis with the largest gain, so that the user can judge it."""
    measurable = {a: c for a, c in judged.items() if c.decision != "not_measurable"}
    looks = len(base.effects()) * len(judged)  # the user chose the effect, but the choice of axis needs the same certainty
    sure = [a for a, c in measurable.items() if proven(c, looks)]
    return sure or sorted((a for a, c in measurable.items() if c.values), key=lambda a: measurable[a].chance)[:1]


def _reason(session: Session, model: Model, effect: Effect, axes: list[str]) -> str:
    """The reason why an effect is not added on any axis, in words."""
    lacking = next((effect.missing(session.about(a).runs, AXES.index(a)) for a in axes), None)
    if all(model.term(effect.id, a) is not None for a in axes):
        return "the model already has it on every axis"
    if lacking is not None:
        return f"the session lacks {lacking}"
    return f"this session does not show it; to measure it: {effect.measure_next_in(session.runs)}"
