"""The output of the verbs for sessions whose reference is gravity."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.digits import negligible, percentage, shares
from gyrocal.errors import InputError
from gyrocal.files import replacing
from gyrocal.gravity import calibrate as calibration
from gyrocal.gravity import compare as comparison
from gyrocal.gravity import diagnose as diagnosis
from gyrocal.gravity.as_is import compare_as_is
from gyrocal.gravity.budget import BudgetRow, budget
from gyrocal.gravity.calibrate import Calibration, misalignment
from gyrocal.gravity.compare import Comparison
from gyrocal.gravity.diagnose import Diagnosis
from gyrocal.gravity.scene import Scene
from gyrocal.present.output import emit, plus_minus, stderr, stdout, table
from gyrocal.present.report import (
    ANGLES,
    BLOCKED,
    MOVED,
    NOT_KEPT,
    REJECTED_SHOWN,
    angle_row,
    deg,
    kept_in,
    moved_rows,
    print_note,
    print_warnings,
    sizes,
)
from gyrocal.present.verdict import adequate, first_sentence, high_floor, left_over, nothing_found, stands_on
from gyrocal.recording.session import AXES, Session
from gyrocal.units import RateUnit, number_of, unit_of

RESTS_SHOWN = 10
"""Of more rests, the first ones and the last are listed."""


def show_calibration(
    session: Session, seconds: Sequence[float | None] | None, methods: Sequence[str] | None, model: str | None, as_json: bool,
    axis: str | None = None,
) -> None:  # fmt: skip
    """Calibrate a session by gravity and print the result, as JSON if asked."""
    found = calibration.calibrate(session, seconds, methods, model).about(axis)
    emit(found.to_json()) if as_json else print_calibration(found)


def show_compare(
    session: Session, model: str | None, residuals: Path | None, page: Path | None, as_json: bool, as_is: bool = False,
    axis: str | None = None,
) -> None:
    """Compare a session by gravity and print the result. Raises InputError if a page or pictures are wanted."""
    if page is not None:
        raise InputError(f"{page}: a page shows rates, and the reference is gravity; use --residuals for a table of movements")
    found = (compare_as_is if as_is else comparison.compare)(session, model)
    if axis is not None:
        found = found.on(axis)
    if residuals is not None:
        frame = comparison.residual_table(found)
        try:
            with replacing(residuals) as partial:
                frame.write_parquet(partial) if residuals.suffix == ".parquet" else frame.write_csv(partial)
        except OSError as error:
            raise InputError(f"{residuals}: {error.strerror}") from None
    emit(found.to_json()) if as_json else print_comparison(found)


def show_diagnose(
    session: Session, path: Path, model: str | None, formulas: Sequence[str], as_json: bool, axis: str | None = None
) -> None:
    """Diagnose a session by gravity and print the result, as JSON if asked."""
    found = diagnosis.diagnose(session, model, formulas)
    if axis is not None:
        found = found.on(axis)
    emit(found.to_json()) if as_json else print_diagnosis(found, path, model)


def show_add(
    session: Session, effect: str, start: Path | None, target: Path | None, only_day: int | None, as_json: bool,
    axis: str | None = None,
) -> None:
    """Raise InputError for ``--heldout-day``, because the movements of all units are judged."""
    if only_day is not None:
        raise InputError(f"--heldout-day {only_day}: a session by gravity is judged on all its movements; leave the option out")
    before, after = diagnosis.add(session, start, effect, axis=axis)
    if target is not None:
        after.fit.model.save(target)
    if as_json:
        warnings = [w.to_json() for w in before.warnings]
        emit({"before": before.to_json(), "after": after.to_json(), "warnings": warnings})
        return
    print_warnings(before.warnings)
    if before.note:
        stdout.print(before.note, style="bold", markup=False)
    rows = [angle_row("before", before.pooled), angle_row("after", after.pooled)]
    table("Held-out angle between movements and gravity, deg", ANGLES, rows)
    stdout.print(f"{target or NOT_KEPT}: {', '.join(after.fit.model.ids)}")
    stdout.print(headline(after), style="bold", markup=False)


def show_explain(
    session: Session, path: Path, start: Path | None, target: Path | None, most_steps: int, page: Path | None, as_json: bool
) -> None:
    """Raise InputError if a page is wanted."""
    if page is not None:
        raise InputError(f"{page}: a page shows rates, and the reference is gravity; leave --html out")
    found = diagnosis.explain(session, start, most_steps)
    if found.verdict != "implausible" and target is not None:
        found.model.save(target)
    if as_json:
        emit(found.to_json())
        if found.verdict == "implausible" and target is not None:
            stderr.print(kept_in(target, found.model.ids, found.verdict))
        return
    rows = [
        [", ".join(s.effects), ", ".join(sorted(s.axes)), deg(s.before.pooled.excess_deg), deg(s.after.pooled.excess_deg),
         "yes" if s.matters else "no"]
        for s in found.steps
    ]  # fmt: skip
    if rows:
        table("Effects added", ["effect:", "axes:", "excess before, deg", "after", "matters:"], rows)
    print_diagnosis(found.last, path, None if target is None else str(target))
    stdout.print(kept_in(target, found.model.ids, found.verdict))
    if found.verdict == "adequate" and found.steps:
        compared = found.last.comparison.to_json()
        text = left_over(compared, "With these effects the model is adequate", "With these effects no test finds a misfit")
        stdout.print(text, style="bold", markup=False)


def headline(c: Comparison) -> str:
    """The verdict in one sentence."""
    if c.verdict == "implausible":
        return BLOCKED
    if c.verdict == "adequate":
        return adequate(c.to_json())
    first = c.where[0]
    if c.moved is not None:
        return f"The model no longer holds: on {first.axis}, against {first.against.replace('_', ' ')} ({first.note})."
    return f"The model does not fit: on {first.axis}, against {first.against.replace('_', ' ')} ({first.note})."


def print_comparison(c: Comparison) -> None:
    """Print the levels by the axis about which a movement mainly turns, and where the model fails."""
    print_warnings(c.warnings)
    scene = c.fit.scene
    stdout.print(f"{_rests_and_movements(scene)}; rests begin at {_begins(scene)} s")
    together = [angle_row("all", c.pooled)] if len(c.per_axis) > 1 else []
    table("", ANGLES, [*(angle_row(f"about {axis}", v) for axis, v in c.per_axis.items()), *together])
    stdout.print(f"model: {', '.join(c.fit.model.ids)}; held out: {c.held_out}")
    if c.note:
        stdout.print(c.note, markup=False)
    if c.where:
        rows = [[f.axis, f.against.replace("_", " "), f"{f.strength:.1f}", f.note] for f in c.where]
        table("Where it fails", ["axis:", "against:", "sigma", "what:"], rows)
    if c.moved is not None:
        table("What has moved", MOVED, moved_rows(c.moved))
    print_note(high_floor(c.to_json()))
    print_note(stands_on(c.to_json()))
    stdout.print(headline(c), style="bold", markup=False)


def _rests_and_movements(scene: Scene) -> str:
    return f"{number_of(len(scene.rests), 'rest')}, {number_of(len(scene.movements), 'movement')}"


def print_diagnosis(d: Diagnosis, session: Path, model: str | None) -> None:
    """Print the candidates, the effects that such a session cannot show, and the verdict."""
    print_warnings(d.comparison.warnings)
    passed = [c for c in d.candidates if c.decision in ("add", "suggest")]
    rejected = [c for c in d.candidates if c.decision == "reject"]
    table("", ["effect:", "axis:", "decision:", "explained", "held-out gain", "size:"],
          [_candidate(c) for c in (*passed, *rejected[:REJECTED_SHOWN])])  # fmt: skip
    unseen = {c.effect.id: c.next_measurement for c in d.candidates if c.decision == "not_measurable"}
    shown = {c.effect.id for c in (*passed, *rejected)}
    rows = [[name, text] for name, text in unseen.items() if name not in shown]
    if rows:
        table("What rests and movements cannot show", ["effect:", "why:"], rows)
    best = d.best
    target = model if model and model.endswith(".toml") else "model.toml"
    if d.verdict == "add" and best is not None:
        cause = first_sentence(best.effect.cause)
        axes = ", ".join(sorted(c.axis for c in d.candidates if c.decision == "add" and c.effect.id == best.effect.id))
        stdout.print(f"Missing: {best.effect.title.lower()} on {axes}. {cause}", style="bold", markup=False)
        stdout.print(f"next: gyrocal add {best.effect.id} {session} --model {target}")
    elif d.verdict == "ambiguous" and best is not None:
        told = f"One of {', '.join(best.group)}. To tell them apart: {best.next_measurement}."
        stdout.print(told, style="bold", markup=False)
    elif d.verdict == "adequate":
        stdout.print(nothing_found(d.candidates, d.comparison.to_json()), style="bold", markup=False)
    else:
        stdout.print(headline(d.comparison), style="bold", markup=False)


def _candidate(c: Candidate) -> list[str]:
    return [
        c.effect.id, c.axis, c.decision, "-" if c.explained is None else percentage(c.explained),
        "-" if c.gain is None else plus_minus(c.gain, c.gain_se), sizes(c),
    ]  # fmt: skip


def print_calibration(c: Calibration) -> None:
    """Print the rests, the estimates, the misalignment and the error budget."""
    print_warnings(c.warnings)
    for name, fitted in c.fits.items():
        scene = fitted.scene
        turned = scene.turned_deg
        stdout.print(
            f"{name}: {_rests_and_movements(scene)} that turn gravity by "
            f"{turned.min():.0f} to {turned.max():.0f} deg; rests begin at {_begins(scene)} s",
            markup=False,
        )
    unit = unit_of(e.bias_dps for e in c.estimates)
    rows = [
        [e.scenario, e.axis, "-" if e.scale is None else plus_minus(100 * e.scale, _percent(e.scale_se)),
         *unit.pair(e.bias_dps, e.bias_se_dps), f"{e.misfit or 0:.2f}", "yes" if e.trusted else "no: " + ", ".join(e.flags)]
        for e in c.estimates
    ]  # fmt: skip
    table("", ["scenario:", "axis:", "scale %", f"bias {unit.name}", f"± {unit.name}", "misfit", "trusted:"], rows)
    cross = [
        [row["scenario"], row["axis"], row["about"],
         "-" if row["value"] is None else plus_minus(100 * row["value"], _percent(row["se"]))]
        for name, fitted in c.fits.items() for row in misalignment(fitted, name)
    ]  # fmt: skip
    table("What an axis reads of rotation about another", ["scenario:", "axis:", "about:", "%"], cross)
    for name, fitted in c.fits.items():
        print_accelerometer(fitted.scene, f"Accelerometer, {name}" if len(c.fits) > 1 else "Accelerometer")
    rows = [row for fitted in c.fits.values() for row in _shares(budget(fitted), unit)]
    table("Where the error comes from", ["axis:", "cause:", "scale ± %", f"bias ± {unit.name}", "to lower it:"], rows)


def print_accelerometer(scene: Scene, title: str) -> None:
    """Print the accelerometer: scale, bias, and what an axis reads of the acceleration along the axes before it."""
    found, misfit = scene.accelerometer_model, scene.accelerometer.misfit
    rows = []
    for i, axis in enumerate(AXES):
        cross = [f"{AXES[j]} {plus_minus(100 * found.matrix[i][j], 100 * found.matrix_se[i][j])}" for j in range(i)]
        rows.append([
            axis, plus_minus(100 * (found.matrix[i][i] - 1), 100 * found.matrix_se[i][i]),
            plus_minus(1e3 * found.bias_g[i], 1e3 * found.bias_se_g[i]), ", ".join(cross) or "-",
        ])  # fmt: skip
    table(title, ["axis:", "scale %", "bias mg", "reads of another axis, %:"], rows)
    stdout.print(f"misfit of its rests {misfit:.2f}: 1 is adequate; its x axis is an axis of the frame")


def _shares(rows: Sequence[BudgetRow], unit: RateUnit) -> list[list[str]]:
    """Axis, cause, parts of the errors of scale and bias, and advice where there is something to lower."""
    told = []
    for axis in dict.fromkeys(row.axis for row in rows):
        mine = [row for row in rows if row.axis == axis]
        scale = shares([(row.scale_se, True) for row in mine], 100.0)
        bias = shares([(row.bias_se_dps, True) for row in mine], unit.per_dps)
        for row, s, b in zip(mine, scale, bias, strict=True):
            told.append([axis, row.cause, s, b, "" if negligible(s) and negligible(b) else row.advice])
    return told


def _begins(scene: Scene) -> str:
    """When the rests begin, s; of many the first ones and the last."""
    told = [f"{scene.session.runs[r.run].sample_s[r.start]:.1f}" for r in scene.rests]
    return ", ".join(told if len(told) <= RESTS_SHOWN else [*told[: RESTS_SHOWN - 1], "...", told[-1]])


def _percent(se: float | None) -> float | None:
    return None if se is None else 100 * se
