"""Comparison of a model with the measurements: the error beyond the noise, and where it appears.

``rms`` is computed from held-out samples. ``floor`` is the rms that noise alone would leave, ``excess`` the remainder; both are
computed in :mod:`gyrocal.diagnosis.residual.levels`. A missing effect increases the excess. :func:`measure` runs the tests of
the residual; :func:`gyrocal.diagnosis.answer.compare.compare` adds what naming an effect finds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

from gyrocal import plausibility, tails
from gyrocal.diagnosis.residual.angles import Angles, by_angle
from gyrocal.diagnosis.residual.beyond_errors import beyond_errors
from gyrocal.diagnosis.residual.bounded_noise import bounded
from gyrocal.diagnosis.residual.drawn_size import described, described_again, drawn_power, most_visible, variance
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.diagnosis.residual.judged import Judged, on_axis
from gyrocal.diagnosis.residual.levels import (
    Cleaned,
    Floor,
    Level,
    MeanSquares,
    Remainder,
    Scatter,
    beside_findings,
    floor_of,
    of_misfit,
    pooled,
    scatter_of,
    spectrum_of,
)
from gyrocal.diagnosis.residual.misfit import Misfit, find_misfit, of_frequency
from gyrocal.diagnosis.residual.parameter_moved import Moved
from gyrocal.diagnosis.residual.probes import of_session
from gyrocal.diagnosis.residual.rounding import rounding_power
from gyrocal.diagnosis.residual.told_once import beside_earth, each_once, strongest_first, without_echoes
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.inference import heldout
from gyrocal.inference.fit import beside_misfit, fit
from gyrocal.inference.fitted import AxisFit, Fit
from gyrocal.inference.noise_shape import of_slopes
from gyrocal.noise.spectrum import Spectrum
from gyrocal.policy import POLICY
from gyrocal.recording.register import FIRST_S, registered
from gyrocal.recording.registration import ReferenceParameter
from gyrocal.recording.session import AXES, Axis, Session
from gyrocal.threads import each, one_thread
from gyrocal.units import rate_text
from gyrocal.warning import Warning

Progress = Callable[[str], None]


@dataclass(frozen=True, repr=False, eq=False)
class Comparison(Judged):
    """Comparison of a model with a session. ``fit`` has the model fitted to all data; levels are in deg/s."""

    fit: Fit
    likeliest: Fit = field(repr=False)
    """The same model with the likeliest noise, against which effects are judged. Where the model misfits, part of that noise is
    the misfit, and ``fit`` has the noise that is left beside it (:mod:`gyrocal.diagnosis.residual.bounded_noise`)."""
    pooled: Level
    per_axis: dict[str, Level]
    where: list[Finding]
    held_out: str
    """The unit that was left out in turn: ``day``, ``scenario``, ``run`` or ``time``; ``none`` if no unit could be left out."""
    spectra: dict[str, Spectrum] = field(repr=False)
    scatter: dict[str, Scatter] = field(repr=False)
    """How the readings scatter within blocks, by axis. This is the fast part of the floor."""

    squares: dict[str, MeanSquares] = field(repr=False)
    floors: dict[str, Floor] = field(repr=False)
    nearest: dict[str, Finding] = field(repr=False)
    """The probe that fits best on each axis, whether it is a finding or not."""
    note: str = ""
    """A remark for the user about how this comparison was made; empty if there is none."""
    warnings: list[Warning] = field(default_factory=list)
    moved: list[Moved] | None = None
    """What has become of the parameters of a model that is held against the session as it is; else None."""
    angles: Angles | None = field(default=None, repr=False)
    """Net angles of the runs, by which the session is judged if a run's rate is not known; otherwise None."""

    @property
    def cycles(self) -> int:
        """The number of power cycles."""
        return len(self.fit.session.scenarios)

    @property
    def ids(self) -> list[str]:
        """Ids of the model's effects and noise components, and of what was estimated about the recording's reference."""
        of_recording = dict.fromkeys(p.effect for p in self.registration)
        return [*self.fit.model.ids, *of_recording]

    @property
    def registration(self) -> list[ReferenceParameter]:
        """What was estimated of the reference's frame and clock; in short recordings no drift that they do not show."""
        session = self.fit.session
        long = max(run.duration_s for run in session.runs) >= FIRST_S
        return [
            p for p in session.registration_parameters
            if long or p.name != "e" or (p.se is not None and abs(p.value) > POLICY.excess_errors * p.se)
        ]

    @property
    def judged(self) -> list[str]:
        """The axes without a blocking warning. Only these are judged."""
        blocked = plausibility.blocked(self.warnings, AXES)
        return [axis for axis in self.per_axis if axis not in blocked]

    @property
    def unsure(self) -> set[str]:
        """The axes on which no effect is named, because the true rate may be another one."""
        return plausibility.unsure(self.warnings, self.fit.session)

    def excess_share(self, axis: str) -> float:
        """The excess of an axis over its floor, of all or within power cycles, whichever is larger; 0 if it is not known.

        It is that of net angles in a session that is judged by them.
        """
        if self.angles is not None:
            of_angle = self.angles.level(axis)
            excess, floor = of_angle.excess_deg or 0.0, of_angle.floor_deg or 0.0
        else:
            level = self.per_axis[axis]
            excess, floor = max(level.excess_dps or 0.0, level.excess_within_dps or 0.0), level.floor_dps
        return excess / floor if floor > 0 else 0.0

    @property
    def own_axis(self) -> str:
        """The session's axis."""
        return self.fit.session.axis

    def on(self, axis: str) -> Comparison:
        """The comparison on one axis, as if the session were about it. Raises InputError if the model does not cover it."""
        if axis not in self.per_axis:
            raise InputError(f"--axis {axis}: the model covers {', '.join(self.per_axis)}")
        told, likeliest = self.fit.on(axis), self.likeliest.on(axis)
        session = replace(told.session, axis=cast(Axis, axis))
        return replace(
            self, fit=replace(told, session=session, model=told.model.about(axis)), likeliest=likeliest,
            pooled=self.per_axis[axis], per_axis={axis: self.per_axis[axis]},
            where=on_axis(self.where, axis), warnings=on_axis(self.warnings, axis),
            moved=None if self.moved is None else on_axis(self.moved, axis),
            angles=None if self.angles is None else self.angles.on(axis),
        )  # fmt: skip

    def to_json(self) -> dict[str, Any]:
        return {
            "model": self.ids,
            "residual": "rate" if self.angles is None else "angle",
            **(self.pooled if self.angles is None else self.angles.level()).to_json(),
            "per_axis": {
                axis: (level if self.angles is None else self.angles.level(axis)).to_json()
                for axis, level in self.per_axis.items()
            },
            "verdict": self.verdict,
            "where": self.where_json(),
            "held_out": self.held_out,
            "note": self.note,
            "parameters": self.fit.model.values_json() + [
                {"effect": p.effect, "axis": None, "name": p.name, "value": p.value, "se": p.se}
                for p in self.registration
            ],
            **({} if self.moved is None else {"as_is": True, "moved": [m.to_json() for m in self.moved]}),
            "warnings": [w.to_json() for w in self.warnings],
        }


@dataclass(frozen=True)
class _Measured:
    """One axis: in-sample residuals, and how the readings scatter within blocks."""

    remainder: Remainder
    scatter: Scatter


@dataclass(frozen=True)
class _Drawn:
    """One axis as it is told and drawn: the fit with the noise beside the findings, its mean squares, and its floor."""

    fit: AxisFit
    squares: MeanSquares
    floor: Floor

    @staticmethod
    def of(fitted: Fit, axis: str, clean: AxisFit, folds: list[heldout.Fold], scatter: Scatter) -> _Drawn:
        """``clean`` is the fit beside the misfit, or that of the model itself where nothing is found."""
        current = fitted.axes[axis]
        fit = current if clean is current else bounded(current, clean)
        held = heldout.predictions(fitted.on(axis, fit), folds)
        squares = MeanSquares.of(held) if clean is current else of_misfit(fit, held, folds)
        return _Drawn(fit, squares, floor_of(fit, folds, scatter, clean))


def _drawn(
    fitted: Fit, misfit: Misfit, folds: list[heldout.Fold], scatter: dict[str, Scatter], judged: list[str]
) -> tuple[dict[str, _Drawn], list[Finding]]:
    """Each axis as it is drawn, and all findings in the words of what is drawn.

    An excess that follows a variable is found last. The noise is then what is left beside that too.
    """

    def beside(found: Sequence[Finding], axes: Iterable[str]) -> dict[str, _Drawn]:
        listed = list(axes)

        def on(axis: str) -> _Drawn:
            return _Drawn.of(fitted, axis, beside_findings(fitted.axes[axis], axis, found), folds, scatter[axis])

        return dict(zip(listed, each(on, listed, fitted.session.rows), strict=True))

    drawn = beside(misfit.found, fitted.axes)
    told = replace(misfit, found=_described_again(fitted, drawn, misfit.found))
    where = _with_left_over(replace(fitted, axes={a: d.fit for a, d in drawn.items()}), told, drawn, judged)
    known = {id(f.shape) for f in misfit.found}
    more = {f.axis for f in where if f.shape is not None and id(f.shape) not in known}
    if more:
        drawn |= beside(where, more)
        where = [*_described_again(fitted, drawn, where)]
    return drawn, where


def _described_again(fitted: Fit, drawn: dict[str, _Drawn], found: Sequence[Finding]) -> list[Finding]:
    """The findings in the size and words of the residual that is drawn, where that is another one."""
    changed = [axis for axis in fitted.axes if drawn[axis].fit is not fitted.axes[axis]]
    return [described_again(drawn[f.axis].fit, f) if f.axis in changed else f for f in found]


@one_thread
def measure(
    session: Session, model: Model | str | Path | None = None, *, only_day: int | None = None, about: bool = False,
    progress: Progress | None = None,
) -> Comparison:  # fmt: skip
    """Fit a model to a session, judge it on held-out data, and test its residual.

    ``only_day`` restricts the held-out data to one day; ``about`` is that of :func:`gyrocal.inference.fit.fit`. Raises
    InputError if the model has no term on any axis, or if the day cannot be left out.
    """
    opened = Model.open(model)
    session = registered(session)
    warnings = plausibility.check(session, opened)
    fitted = fit(session, opened, about=about, progress=progress)
    if not fitted.axes:
        raise InputError("the model has no term on any axis; give it scale and bias at least")
    folds = heldout.folds(fitted, only_day)
    if only_day is not None and not folds:
        days = ", ".join(map(str, session.days)) or "none"
        raise InputError(f"--heldout-day {only_day}: no such day, or it cannot be left out; the session's days: {days}")
    if progress is not None:
        progress("judging on held-out data")

    def measured(axis: str) -> _Measured:
        cleaned = Cleaned.of(fitted, axis)
        lines = spectrum_of(fitted, axis, cleaned.by_run)
        return _Measured(Remainder(cleaned.by_run, lines), scatter_of(fitted, axis, cleaned, lines))

    on = dict(zip(fitted.axes, each(measured, fitted.axes, session.rows), strict=True))
    spectra = {axis: m.remainder.spectrum for axis, m in on.items()}
    scatter = {axis: m.scatter for axis, m in on.items()}
    blocked = plausibility.blocked(warnings, AXES)
    judged = [a for a in fitted.axes if a not in blocked]
    misfit = find_misfit(fitted, {axis: m.remainder for axis, m in on.items()}, judged, progress)

    drawn, where = _drawn(fitted, misfit, folds, scatter, judged)
    squares, floors = {a: d.squares for a, d in drawn.items()}, {a: d.floor for a, d in drawn.items()}
    per_axis = {axis: Level.of(squares[axis], floors[axis]) for axis in fitted.axes}
    failing = {f.axis for f in where}
    warnings = plausibility.of_fit(fitted, warnings, failing)
    told = beside_misfit(fitted, [a for a in fitted.axes if a in failing], {a: d.fit for a, d in drawn.items()})
    together = pooled(squares, floors, plausibility.absent(warnings))
    angles = Angles.of(told, folds) if by_angle(session) else None
    where += beyond_errors(session, per_axis, angles, misfit.nearest, [a for a in judged if a not in failing])
    where = each_once(beside_earth(f, session.runs) for f in where)
    return Comparison(
        told, fitted, together, per_axis, where, _held_out(session, folds), spectra, scatter, squares, floors,
        misfit.nearest, warnings=warnings, angles=angles,
    )  # fmt: skip


def _with_left_over(
    fitted: Fit, misfit: Misfit, drawn: dict[str, _Drawn], judged: list[str]
) -> list[Finding]:
    """The findings of all axes with an excess beyond that of noise, on axes where the others describe little of it."""
    out = []
    for axis in fitted.axes:
        current, found = fitted.axes[axis], [f for f in misfit.found if f.axis == axis]
        # the slope of measured angles has noise that no floor of rates describes
        if axis in judged and drawn[axis].squares.samples and axis in misfit.nearest and not of_slopes(current):
            excess = of_excess(drawn[axis].squares, drawn[axis].floor, misfit.nearest[axis])
            large = excess.amplitude_dps**2 > max(POLICY.least_excess**2 * drawn[axis].floor.within, rounding_power(current))
            told = sum(drawn_power(current, f) for f in found)
            if excess.chance < misfit.share and large and told <= POLICY.told * max(excess.amplitude_dps**2, variance(current)):
                shown = _as_drawn(fitted, excess)
                if told <= POLICY.told * max(excess.amplitude_dps**2, drawn_power(current, shown)):
                    others = without_echoes(fitted, axis, [shown, *found], misfit.share, of_frequency)
                    found = [shown, *(f for f in others if f is not shown)]
        out += found
    return strongest_first(out)


def _as_drawn(fitted: Fit, excess: Finding) -> Finding:
    """An excess as a finding against the variable that the residual follows, in the words of the picture.

    It stays as it is if the residual follows none.
    """
    shapes = [(against, s) for against, shapes in of_session(fitted.session, AXES.index(excess.axis)) for s in shapes]
    current = fitted.axes[excess.axis]
    seen = most_visible(current, shapes)
    if seen is None:
        return excess
    amplitude_dps, note = described(current, seen[1])
    return replace(excess, against=seen[0], shape=seen[1], amplitude_dps=amplitude_dps, note=note)


def of_excess(squares: MeanSquares, floor: Floor, nearest: Finding) -> Finding:
    """The excess within power cycles as a finding, against the variable that fits best."""
    level = Level.of(squares, floor)
    sigma = (squares.within - floor.within) / floor.error_within if floor.error_within > 0 else 0.0
    excess_dps = level.excess_within_dps or 0.0
    note = f"{rate_text(excess_dps)} more than noise leaves, in no shape that a test knows"
    return Finding(
        nearest.axis, nearest.against, max(0.0, sigma), float(tails.normal(sigma)), excess_dps, note, nearest.shape
    )  # fmt: skip


def _held_out(session: Session, folds: list[heldout.Fold]) -> str:
    if not folds:
        return "none"
    if folds[0].time is not None:
        return "time"
    labels = {f.label for f in folds}
    if labels <= {str(r.day) for r in session.runs}:
        return "day"
    return "scenario" if labels <= set(session.scenarios) else "run"


def beside_named(comparison: Comparison, clean: Mapping[str, AxisFit], only_day: int | None = None) -> Comparison:
    """The comparison with the noise that is left beside effects that only their names have shown, by axis in ``clean``."""
    fitted, folds = comparison.likeliest, heldout.folds(comparison.likeliest, only_day)
    drawn = {a: _Drawn.of(fitted, a, fit, folds, comparison.scatter[a]) for a, fit in clean.items()}
    squares = {**comparison.squares, **{a: d.squares for a, d in drawn.items()}}
    floors = {**comparison.floors, **{a: d.floor for a, d in drawn.items()}}
    told = beside_misfit(fitted, drawn, {a: d.fit for a, d in drawn.items()})
    return replace(
        comparison, fit=told, squares=squares, floors=floors, per_axis={a: Level.of(squares[a], floors[a]) for a in squares},
        pooled=pooled(squares, floors, plausibility.absent(comparison.warnings)),
        angles=comparison.angles and Angles.of(told, folds),
    )  # fmt: skip


def with_floor_of(before: Comparison, after: Comparison) -> Comparison:
    """The comparison of the poorer model, with its excess computed over the floor of the richer model."""
    per_axis = {a: Level.of(before.squares[a], after.floors[a]) for a in before.per_axis}
    together = pooled(before.squares, after.floors, plausibility.absent(before.warnings))
    angles = before.angles and after.angles and replace(before.angles, noise=after.angles.noise)
    return replace(
        before, pooled=together, per_axis=per_axis, floors={a: after.floors[a] for a in before.floors}, angles=angles
    )
