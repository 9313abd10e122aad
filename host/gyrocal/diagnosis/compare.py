"""Compare a model with the measurements: how much error exceeds the noise, and where it appears.

``rms`` is computed from held-out samples. ``floor`` is the rms that noise alone would leave. It consists of white noise and
quantisation (the scatter within a tenth of a second, without spectral lines), drift, and the turn-on bias, which no model can
predict. ``excess`` is the remainder, ``sqrt(max(0, rms^2 - floor^2))``. A missing effect increases the excess.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal import plausibility
from gyrocal.diagnosis.finding import Finding
from gyrocal.diagnosis.levels import Level, floor_dps, level_of, residuals, squares_of, white_power
from gyrocal.diagnosis.misfit import find_misfit
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.inference import heldout
from gyrocal.inference.fit import fit
from gyrocal.inference.fitted import Fit
from gyrocal.noise.spectrum import Spectrum, spectrum
from gyrocal.recording.session import AXES, Array, Session
from gyrocal.threads import each, one_thread
from gyrocal.warning import Warning

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Comparison:
    """The result of :func:`compare`. ``fit`` holds the model fitted to all data; levels are in deg/s."""

    fit: Fit
    pooled: Level
    per_axis: dict[str, Level]
    where: list[Finding]
    held_out: str
    """The unit that was left out in turn: ``day``, ``scenario``, ``run`` or ``time``; ``none`` if no unit could be left out."""
    spectra: dict[str, Spectrum] = field(repr=False)
    white_power: dict[str, float] = field(repr=False)
    """Mean square of white noise and quantisation by axis, dps^2. This is the fast part of the floor."""

    note: str = ""
    """A remark for the user about how this comparison was made; empty if there is none."""
    warnings: list[Warning] = field(default_factory=list)

    @property
    def floors(self) -> dict[str, float]:
        """The floor of each axis, deg/s."""
        return {axis: level.floor_dps for axis, level in self.per_axis.items()}

    @property
    def judged(self) -> list[str]:
        """The axes without a blocking warning. Only these are judged."""
        blocked = plausibility.blocked(self.warnings, AXES)
        return [axis for axis in self.per_axis if axis not in blocked]

    @property
    def implausible(self) -> bool:
        """True if a blocking warning applies to the session's own axis."""
        return any(w.blocks(self.fit.session.axis) for w in self.warnings)

    @property
    def verdict(self) -> str:
        if self.implausible:
            return "implausible"
        return "misfit" if self.where else "adequate"

    def to_json(self) -> dict[str, Any]:
        return {
            "model": self.fit.model.ids,
            **self.pooled.to_json(),
            "per_axis": {axis: level.to_json() for axis, level in self.per_axis.items()},
            "verdict": self.verdict,
            "where": [
                {"axis": f.axis, "against": f.against, "strength": round(f.strength, 3), "note": f.note}
                for f in self.where
            ],
            "held_out": self.held_out,
            "note": self.note,
            "parameters": [
                {"effect": line.id, "axis": line.axis, "name": name, "value": value, "se": line.se.get(name)}
                for line in self.fit.model.lines()
                for name, value in line.values.items()
            ],
            "warnings": [w.to_json() for w in self.warnings],
        }


@dataclass(frozen=True)
class _Measured:
    """Measurements on one axis.

    ``squares`` [3, 2] holds sums of squares (dps^2) and counts of held-out samples, ``spectrum`` is that of the residual, and
    ``white_power`` is the mean square of the white noise (dps^2).
    """

    squares: Array
    spectrum: Spectrum
    white_power: float


@one_thread
def compare(
    session: Session, model: Model | str | Path | None = None, *, floor_from: dict[str, float] | None = None,
    only_day: int | None = None,
    progress: Progress | None = None,
) -> Comparison:  # fmt: skip
    """Fit a model to a session, judge it on held-out data, and find where it fails.

    ``floor_from`` gives the floor of each axis in deg/s (``Comparison.floors`` of the richer model), so that two models can be
    compared over the same floor. ``only_day`` restricts the held-out data to one day. Raises InputError if the model has no
    term on any axis, or if the day cannot be left out.
    """
    opened = Model.open(model)
    warnings = plausibility.check(session, opened)
    fitted = fit(session, opened, progress=progress)
    if not fitted.axes:
        raise InputError("the model has no term on any axis; give it scale and bias at least")
    folds = heldout.folds(fitted, only_day)
    if only_day is not None and not folds:
        days = ", ".join(map(str, session.days)) or "none"
        raise InputError(f"--heldout-day {only_day}: no such day, or it cannot be left out; the session's days: {days}")
    if progress is not None:
        progress("judging on held-out data")

    def measured(axis: str) -> _Measured:
        by_run = residuals(fitted, axis)
        lines = spectrum(list(by_run.values()), session.sample_rate_hz)
        squares = squares_of(heldout.predictions(fitted.on(axis), folds))
        return _Measured(squares, lines, white_power(fitted, axis, by_run, lines))

    on = dict(zip(fitted.axes, each(measured, fitted.axes, session.rows), strict=True))
    squares = np.sum([m.squares for m in on.values()], axis=0)
    spectra = {axis: m.spectrum for axis, m in on.items()}
    white = {axis: m.white_power for axis, m in on.items()}
    blocked = plausibility.blocked(warnings, AXES)
    where = find_misfit(fitted, spectra, [a for a in fitted.axes if a not in blocked], progress)
    floors = floor_from or {axis: floor_dps(fitted, axis, where, white[axis]) for axis in fitted.axes}
    per_axis = {axis: level_of(squares[[AXES.index(axis)]], floors[axis]) for axis in fitted.axes}
    pooled = level_of(squares, float(np.sqrt(np.mean([f**2 for f in floors.values()]))))
    return Comparison(fitted, pooled, per_axis, where, _held_out(session, folds), spectra, white, warnings=warnings)


def _held_out(session: Session, folds: list[heldout.Fold]) -> str:
    if not folds:
        return "none"
    if folds[0].time is not None:
        return "time"
    labels = {f.label for f in folds}
    if labels <= {str(r.day) for r in session.runs}:
        return "day"
    return "scenario" if labels <= set(session.scenarios) else "run"


def with_floor_of(before: Comparison, after: Comparison) -> Comparison:
    """The comparison of the poorer model, with its excess computed over the floor of the richer model."""

    def level(old: Level, floor: float) -> Level:
        if old.rms_dps is None:
            return replace(old, floor_dps=floor)
        return replace(old, floor_dps=floor, excess_dps=float(np.sqrt(max(0.0, old.rms_dps**2 - floor**2))))

    per_axis = {a: level(v, after.per_axis[a].floor_dps) for a, v in before.per_axis.items()}
    return replace(before, pooled=level(before.pooled, after.pooled.floor_dps), per_axis=per_axis)
