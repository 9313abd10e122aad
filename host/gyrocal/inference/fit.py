"""The fit of a session: the frame and clock of a three-axis reference, then each axis by :mod:`gyrocal.inference.axis_fit`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from gyrocal.effects.base import Values
from gyrocal.effects.timing import TimingEffect
from gyrocal.error_model.fitted_on import FittedOn
from gyrocal.error_model.model import Model, Term
from gyrocal.inference.axis_fit import fit_axis
from gyrocal.inference.blocks import Blocks, reduce_session
from gyrocal.inference.fitted import AxisFit, Fit
from gyrocal.inference.registering import refined, symmetric
from gyrocal.inference.standard_errors import finish
from gyrocal.inference.turns import beside_leaks
from gyrocal.recording.session import AXES, Session
from gyrocal.threads import each, one_thread

Progress = Callable[[str], None]


@one_thread
def fit(
    session: Session, model: Model, *, blocks: list[Blocks] | None = None, axes: Iterable[str] = AXES, about: bool = False,
    progress: Progress | None = None,
) -> Fit:  # fmt: skip
    """Fit a model's terms and noise to a session; the model returned carries values and standard errors.

    ``about``: linear parameters that the session does not show stay at the model's values instead of zero. Parameters that a
    term holds always do.
    """
    if blocks is None:
        session = refined(session, model)
    reduced = reduce_session(session) if blocks is None else blocks
    seen = {axis: [b.about(axis) for b in reduced] for axis in AXES}

    def on(axis: str) -> AxisFit:
        if progress is not None:
            progress(f"fitting {axis}")
        terms = model.on(axis)
        known = linear_values(terms if about else [t for t in terms if t.held])
        return fit_axis(seen[axis], AXES.index(axis), terms, model.noise_on(axis), known)

    covered = [axis for axis in axes if axis in model.axes]
    return _together(session, reduced, model, dict(zip(covered, each(on, covered, session.rows), strict=True)))


@one_thread
def beside_misfit(fitted: Fit, axes: Iterable[str], drawn: Mapping[str, AxisFit] | None = None) -> Fit:
    """The same fit with errors that contain the misfit which tests of the residual have found on ``axes``.

    ``drawn`` holds fits of the same model with other weights by axis, whose values are told with these errors. Where turns
    about other axes leak into an axis, values and noise are those of a fit that these turns do not pull.
    """

    def wider(current: AxisFit, told: AxisFit) -> AxisFit:
        apart = beside_leaks(current)
        if apart is not current:
            found = finish(apart, reported=True, misfit=True)
            return replace(told, terms=found.terms, noise_model=found.noise_model)
        pairs = zip(told.terms, finish(current, reported=True, misfit=True).terms, strict=True)
        return replace(told, terms=tuple(replace(term, se=beside.se) for term, beside in pairs))

    changed = {axis: wider(fitted.axes[axis], (drawn or fitted.axes)[axis]) for axis in axes}
    return _together(fitted.session, fitted.blocks, fitted.model, {**fitted.axes, **changed})


def _together(session: Session, blocks: list[Blocks], model: Model, fitted: dict[str, AxisFit]) -> Fit:
    terms = {(t.effect_id, t.axis): t for a in fitted.values() for t in a.terms}
    if session.three_axes:
        terms = symmetric(terms)
    noise = {**model.noise, **{axis: a.noise_model for axis, a in fitted.items()}}
    together = tuple(terms.get((t.effect_id, t.axis), t) for t in model.terms)
    result = Model(model.name, together, noise, accelerometer=model.accelerometer)
    return Fit(session, blocks, replace(result, fitted_on=FittedOn.of(session, result.bias_dps)), fitted)


def linear_values(terms: Sequence[Term]) -> dict[str, Values]:
    """The values of the terms whose columns do not depend on them, by the id of the effect."""
    fixed = [t for t in terms if t.values and t.fault is None and t.effect.scope == "session" and not t.effect.nonlinear]
    return {t.effect_id: t.values for t in fixed if not isinstance(t.effect, TimingEffect)}
