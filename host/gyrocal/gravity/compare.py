"""Comparison of a model with movements and rests: the angle error beyond the noise, and the variables that show it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from gyrocal import plausibility, tails
from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.diagnosis.residual.angles import Level
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.diagnosis.residual.judged import Judged, on_axis
from gyrocal.diagnosis.residual.parameter_moved import Moved
from gyrocal.effects.base import effects
from gyrocal.error_model.formula import FormulaEffect
from gyrocal.error_model.model import Model, Term
from gyrocal.gravity import naming, scales
from gyrocal.gravity.evidence import Evidence
from gyrocal.gravity.fit import CROSS, GravityFit, fit, full, why_invisible
from gyrocal.gravity.heldout import HeldOut
from gyrocal.gravity.observations import Rows, parameters
from gyrocal.gravity.scene import Scene
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Session
from gyrocal.warning import Warning, accepted

PROBES = (
    ("rate", "a*rate*abs(rate)**2"), ("direction", "a*abs(rate)"), ("acceleration", "a*ax + b*ay + c*az"),
    ("temperature", "a*temp_c"), ("temperature", "a*temp_c*rate"), ("time", "a*t"),
)  # fmt: skip
"""Variables that residuals are tested against, each with a shape. Rotation about other axes is tested too (as ``rate``)."""


@dataclass(frozen=True, repr=False, eq=False)
class Comparison(Judged):
    """Comparison of a model with a session by gravity; levels in deg."""

    fit: GravityFit
    pooled: Level
    per_axis: dict[str, Level]
    where: list[Finding]
    held_out: str
    warnings: list[Warning]
    evidence: Evidence = field(repr=False)
    held: HeldOut = field(repr=False)
    note: str = ""
    moved: list[Moved] | None = None
    """What has become of the parameters of a model that is held against the session as it is; else None."""

    @property
    def own_axis(self) -> str:
        """The session's axis."""
        return self.fit.scene.session.axis

    def on(self, axis: str) -> Comparison:
        """The comparison on one axis alone: the movements that mainly turn about it, and what its readings leave."""
        return replace(
            self, fit=replace(self.fit, model=self.fit.model.about(axis)), pooled=self.per_axis[axis],
            per_axis={axis: self.per_axis[axis]}, where=on_axis(self.where, axis), warnings=on_axis(self.warnings, axis),
            moved=None if self.moved is None else on_axis(self.moved, axis),
        )  # fmt: skip

    def to_json(self) -> dict[str, Any]:
        return {
            "model": self.fit.model.ids, "residual": "angle", **self.pooled.to_json(),
            "per_axis": {axis: level.to_json() for axis, level in self.per_axis.items()}, "verdict": self.verdict,
            "where": self.where_json(),
            "held_out": self.held_out, "note": self.note,
            "rests": len(self.fit.scene.rests), "movements": len(self.fit.scene.movements),
            "accelerometer": self.fit.scene.accelerometer_json(),
            "parameters": self.fit.model.values_json(),
            **({} if self.moved is None else {"as_is": True, "moved": [m.to_json() for m in self.moved]}),
            "warnings": [w.to_json() for w in self.warnings],
        }  # fmt: skip


def compare(session: Session, model: Model | str | Path | None = None) -> Comparison:
    """Fit a model, judge it on held-out movements, and find where it fails. Raises InputError if there are too few rests."""
    measured = measure(session, model)
    if measured.where or measured.implausible:
        return measured
    return replace(measured, where=findings(measured, naming.candidates(measured.evidence)))


def measure(session: Session, model: Model | str | Path | None = None) -> Comparison:
    """:func:`compare` without the effects of the library."""
    opened = Model.open(model)
    scene = Scene.of(session)
    warnings = [*plausibility.check(session, opened), *scene.warnings]
    fitted = fit(scene, opened)
    if not any(w.code == "scale_implausible" for w in warnings):
        found = scales.implausible(fitted)
        stated = scales.implausible(fitted, fit(scene, full(opened))) if found else found
        about_scales = [*stated, *scales.unseen(fitted, POLICY.largest_scale)]
        warnings += accepted(about_scales, session.accept)
    evidence = Evidence(fitted)
    note = ""
    if fitted.left_out:
        note = f"a session by gravity does not show {', '.join(fitted.left_out)}; the model's values of these stay as they are"
    held = evidence.before
    return Comparison(
        fitted, held.level(np.arange(len(scene.movements))), level_by_axis(fitted, held), _where(evidence), evidence.cut.unit,
        warnings, evidence, held, note,
    )  # fmt: skip


def main_axis(fitted: GravityFit) -> Rows:
    """The sensor's axis about which each movement mainly turns gravity, shape [movements]."""
    scene, turned = fitted.scene, fitted.observations.turned
    up = scene.up[[m.before for m in scene.movements]]
    across = turned - np.sum(turned * up, axis=1)[:, None] * up
    return np.asarray(np.argmax(np.abs(across), axis=1))


def level_by_axis(fitted: GravityFit, held: HeldOut) -> dict[str, Level]:
    """The level of the movements that mainly turn about each axis."""
    about = main_axis(fitted)
    return {axis: held.level(np.flatnonzero(about == i)) for i, axis in enumerate(AXES)}


def _where(evidence: Evidence) -> list[Finding]:
    """Probes in the variables, and chi-square of movements and rests, corrected for the number of all tests."""
    fitted = evidence.fitted
    terms = [
        (against, Term.of(FormulaEffect(text, f"probe_{k}"), axis)) for axis in AXES for k, (against, text) in enumerate(PROBES)
    ]
    cross = effects()[CROSS]
    terms += [
        ("rate", Term.of(cross, axis, {f"m_{other}": 0.0 for other in AXES if other != axis}))
        for axis in AXES if fitted.model.term(cross.id, axis) is None
    ]  # fmt: skip
    terms = [(against, t) for against, t in terms if not why_invisible(t, fitted.scene)]
    evidence.prepare([t for _, t in terms])
    tests = len(terms) + 1 + len(AXES)
    out = []
    for against, term in terms:
        columns = evidence.columns(term)
        beside = evidence.beside(term.effect_id, term.axis)
        found = evidence.gain(columns, [p.prior_sd for p in parameters([term])], beside)
        if found.chance * tests < POLICY.misfit_alarm:
            moving = columns[: fitted.observations.movement_rows] @ found.values
            angle_deg = float(np.rad2deg(np.sqrt(2 * np.mean(moving**2))))
            out.append(_finding(term.axis, against, found.chance, angle_deg, f"{angle_deg:.3g} deg rms"))
    return sorted([*out, *_levels(fitted, tests, bool(out))], key=lambda o: -o.strength)


def _finding(axis: str, against: str, chance: float, angle_deg: float, note: str) -> Finding:
    return Finding(axis, against, float(np.sqrt(tails.chi_square_value(max(chance, 1e-300), 1))), chance, angle_deg, note)


def _levels(fitted: GravityFit, tests: int, known: bool) -> list[Finding]:
    """Scatter beyond the noise that no probe describes: of movements if no probe finds anything, and of rests by axis."""
    out = []
    seen = fitted.observations
    total, freedom = fitted.chi2(np.arange(seen.movement_rows))
    chance = float(tails.chi_square(total, freedom))
    if known:  # an effect in the movements shifts the bias, and with it the rests
        return []
    if chance * tests < POLICY.misfit_alarm:
        about = main_axis(fitted)
        squares = [float(np.sum(fitted.residual[: seen.movement_rows] ** 2 * (np.repeat(about, 2) == i))) for i in range(3)]
        text = f"movements scatter by {np.sqrt(total / freedom):.2f} times the noise"
        return [_finding(AXES[int(np.argmax(squares))], "level", chance, 0.0, text)]
    for i, axis in enumerate(AXES):
        total, freedom = fitted.chi2(seen.rest_rows(i))
        chance = float(tails.chi_square(total, freedom))
        if chance * tests < POLICY.misfit_alarm:
            out.append(_finding(axis, "level", chance, 0.0, f"rests scatter by {np.sqrt(total / freedom):.2f} times the noise"))
    return out


def findings(measured: Comparison, judged: Sequence[Candidate]) -> list[Finding]:
    """The candidates with decision ``add`` as findings."""
    return [
        _finding(c.axis, "rate", c.chance, 0.0, f"in the shape of: {c.effect.title.lower()}")
        for c in judged if c.decision == "add"
    ]


def residual_table(c: Comparison) -> pl.DataFrame:
    """One row for each movement: how far gravity turned by the accelerometer and by the integrated gyroscope.

    ``residual_deg`` is the held-out angle between both final directions, which includes errors across the turn.
    """
    scene, seen = c.fit.scene, c.fit.observations
    about = main_axis(c.fit)
    rows = []
    held = c.held.residual
    for k, m in enumerate(scene.movements):
        run = scene.session.runs[m.run]
        two = np.nan_to_num(held[2 * k : 2 * k + 2])
        up, after = scene.up[m.before], scene.up[m.after]
        measured = float(np.rad2deg(np.arccos(np.clip(up @ after, -1.0, 1.0))))
        # the residual refers to the start of the movement and leads from the measured direction to the prediction
        predicted = after + seen.ends[k].T @ c.evidence.observer.across[m.before].T @ two
        predicted /= np.linalg.norm(predicted)
        modelled = float(np.rad2deg(np.arccos(np.clip(up @ predicted, -1.0, 1.0))))
        rows.append({
            "file": run.file, "t_s": float(run.sample_s[m.stop - 1]), "axis": AXES[about[k]], "measured_deg": measured,
            "modelled_deg": modelled, "residual_deg": float(np.rad2deg(np.linalg.norm(two))),
        })  # fmt: skip
    return pl.DataFrame(rows)
