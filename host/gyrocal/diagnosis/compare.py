"""The model held against the measurements: how much error is left beyond the noise, and where it shows.

``rms`` is of held-out samples. ``floor`` is what noise alone would leave: white noise and quantisation as the scatter within a
tenth of a second shows them (lines taken out), drift, and the turn-on bias, which no model can know beforehand. ``excess`` is
what is left over: ``sqrt(max(0, rms^2 - floor^2))``; it is what a missing effect adds.
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
    """What ``compare`` found. ``fit`` holds the model fitted on all data."""

    fit: Fit
    pooled: Level
    per_axis: dict[str, Level]
    where: list[Finding]
    held_out: str
    """What was left out in turn: ``day``, ``scenario``, ``run``, ``time`` or, where nothing could be, ``none``."""
    spectra: dict[str, Spectrum] = field(repr=False)
    white_power: dict[str, float] = field(repr=False)
    """Mean square of white noise and quantisation, dps^2, by axis: the floor's fast part."""

    note: str = ""
    """What a person should know of how it came about."""
    warnings: list[Warning] = field(default_factory=list)

    @property
    def floors(self) -> dict[str, float]:
        """The floor of each axis, deg/s."""
        return {axis: level.floor_dps for axis, level in self.per_axis.items()}

    @property
    def judged(self) -> list[str]:
        """The axes that can be judged: no blocking warning stands against them."""
        blocked = plausibility.blocked(self.warnings, AXES)
        return [axis for axis in self.per_axis if axis not in blocked]

    @property
    def implausible(self) -> bool:
        """Does a blocking warning stand against the session's own axis?"""
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
    """One axis: sums of squares and counts [3, 2] of held-out samples, spectrum of the residual, power of the white noise."""

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

    ``floor_from``: the richer model's floors by axis (``Comparison.floors``), for both when two models are compared.
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
    """The poorer model's comparison with the richer one's floor."""

    def level(old: Level, floor: float) -> Level:
        if old.rms_dps is None:
            return replace(old, floor_dps=floor)
        return replace(old, floor_dps=floor, excess_dps=float(np.sqrt(max(0.0, old.rms_dps**2 - floor**2))))

    per_axis = {a: level(v, after.per_axis[a].floor_dps) for a, v in before.per_axis.items()}
    return replace(before, pooled=level(before.pooled, after.pooled.floor_dps), per_axis=per_axis)
