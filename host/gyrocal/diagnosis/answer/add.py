"""Add an effect to a model and compare the error before and after."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import reduce
from pathlib import Path
from typing import NamedTuple

from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.diagnosis.naming.decision import proven
from gyrocal.diagnosis.naming.judge import judge
from gyrocal.diagnosis.naming.standing_model import Current
from gyrocal.diagnosis.residual.comparison import Comparison, with_floor_of
from gyrocal.effects import base
from gyrocal.effects.base import Effect
from gyrocal.error_model.formula import effect_or_formula
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
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


def lacking_axes(model: Model, effect_id: str, shown: Sequence[str]) -> list[str]:
    """The axes, of those on which the session can show an effect or a noise component, on which the model lacks it.

    Raises InputError if the model has it already and lacks it on none of them.
    """
    has = [axis for axis in model.axes if model.line(effect_id, axis) is not None]
    lacking = [axis for axis in shown if axis not in has]
    if has and not lacking:
        raise InputError(
            f"{effect_id}: the model has it already, on {', '.join(has)}; `gyrocal diagnose` with this model looks for what "
            "else is missing"
        )
    return lacking


def only_axis(lacking: Sequence[str], axis: str | None) -> list[str]:
    """The axes to add an effect on: those that lack it, or of these ``axis`` alone. Raises InputError if it is none of them."""
    if axis is not None and axis not in lacking:
        raise InputError(f"--axis {axis}: the effect can be added on {', '.join(lacking) or 'no axis'}")
    return list(lacking) if axis is None else [axis]


def effect_named(effect_id: str) -> Effect | None:
    """The effect or formula of this name; None for a component of the noise. Raises InputError if it is none of these."""
    return None if effect_id in COMPONENTS else effect_or_formula(effect_id)


@one_thread
def add(
    session: Session, model: Model | str | Path | None, effect_id: str, *, axis: str | None = None,
    only_day: int | None = None, progress: Progress | None = None,
) -> Added:  # fmt: skip
    """Add an effect on every axis where it can be measured and improves the fit.

    ``effect_id`` is the id of an effect, the id of a noise component, or a formula. A noise component is added on every axis
    of the model. Where no axis proves the effect, ``add`` uses the axis with the largest gain and explains this in
    ``before.note``. ``axis`` restricts it to this axis. ``only_day`` restricts the held-out data to one day. Raises InputError
    for an unknown id, a formula that cannot be parsed, a day that cannot be left out, or an effect that the model has already.
    """
    return attempt(session, model, effect_id, axis=axis, only_day=only_day, progress=progress).added


class Attempt(NamedTuple):
    """The result of :func:`attempt`: what :func:`add` returns, and the effect as it was judged on each axis where it can be."""

    added: Added
    judged: dict[str, Candidate]


@one_thread
def attempt(
    session: Session, model: Model | str | Path | None, effect_id: str, *, axis: str | None = None,
    only_day: int | None = None, progress: Progress | None = None,
) -> Attempt:  # fmt: skip
    """Add an effect as :func:`add` does, and say how it was judged; nothing is judged of a component of the noise."""
    effect = effect_named(effect_id)
    start = Model.open(model)
    if effect is None:
        lacking = lacking_axes(start, effect_id, start.axes)
    else:
        shown = [a for a in start.axes if effect.missing(session.about(a).runs, AXES.index(a)) is None]
        lacking = lacking_axes(start, effect.id, shown)
    wanted = only_axis(lacking, axis)
    before = compare(session, start, only_day=only_day, progress=progress)
    if effect is None:
        noisier = reduce(lambda grown, axis: grown.add(effect_id, axis), start.axes if axis is None else wanted, start)
        after = compare(session, noisier, only_day=only_day, progress=progress)
        return Attempt(Added(with_floor_of(before, after), after, after.fit.model), {})
    axes = [a for a in wanted if a in before.fit.axes]

    def on(axis: str) -> Candidate:
        return judge(Current.of(before, axis), effect)

    judged = dict(zip(axes, each(on, axes, session.rows), strict=True))
    chosen = proven_on(judged) or _likeliest(judged)
    if not chosen:
        told = replace(before, note=f"{effect.id} was not added: {_reason(session, effect, list(before.fit.axes))}")
        return Attempt(Added(with_floor_of(told, before), before, before.fit.model), judged)
    richer = start
    for axis in chosen:
        richer = richer.with_term(Term.of(effect, axis, effect.structure(judged[axis].values)))
    after = compare(session, richer, only_day=only_day, progress=progress)
    return Attempt(Added(with_floor_of(before, after), after, after.fit.model), judged)


def proven_on(judged: dict[str, Candidate]) -> list[str]:
    """The axes on which an effect that was judged on several is proven."""
    looks = len(base.effects()) * len(judged)  # the user chose the effect, but the choice of axis needs the same certainty
    return [a for a, c in judged.items() if c.decision != "not_measurable" and proven(c, looks)]


def _likeliest(judged: dict[str, Candidate]) -> list[str]:
    """The axis with the largest gain, so that the user can judge an effect that no axis proves."""
    fitted = [a for a, c in judged.items() if c.decision != "not_measurable" and c.values]
    return sorted(fitted, key=lambda a: judged[a].chance)[:1]


def _reason(session: Session, effect: Effect, axes: list[str]) -> str:
    """The reason why an effect is not added on any axis, in words."""
    lacking = next((effect.missing(session.about(a).runs, AXES.index(a)) for a in axes), None)
    if lacking is not None:
        return f"the session lacks {lacking}"
    return f"this session does not show it; to measure it: {effect.measure_next_in(session.runs)}"
