"""The words, tables and pictures of results in Python and in a notebook. Importing this module registers them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import polars as pl

from gyrocal.calibration.calibration import Calibration
from gyrocal.diagnosis.answer.diagnose import Diagnosis
from gyrocal.diagnosis.answer.explain import Explanation
from gyrocal.diagnosis.residual.comparison import Comparison
from gyrocal.error_model.model import Model
from gyrocal.gravity import compare as gravity
from gyrocal.gravity import diagnose as gravity_diagnosis
from gyrocal.inference.fitted import Fit
from gyrocal.planning.plan import Plan
from gyrocal.present import explanation, pictures
from gyrocal.present import gravity as by_gravity
from gyrocal.present.figure import new_figure
from gyrocal.present.output import plus_minus
from gyrocal.present.plan import promise, words
from gyrocal.present.preview import preview
from gyrocal.present.report import deg, headline, level_unit, verdict_text
from gyrocal.present.taken import cell
from gyrocal.present.taken import words as from_words
from gyrocal.present.verdict import is_high
from gyrocal.recording.session import Session
from gyrocal.shown import VIEWS, View
from gyrocal.units import number_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEVELS = {"rms_dps": "rms", "floor_dps": "noise floor", "excess_dps": "excess"}
FLOOR_ABOVE = " (the fitted noise expects more than these data show, so that the floor is above the rms)"


def _table(rows: Sequence[dict[str, Any]]) -> pl.DataFrame:
    return pl.DataFrame(rows, infer_schema_length=None)


def _session_words(session: Session) -> str:
    days = f", {number_of(len(session.days), 'day')}" if session.days else ""
    runs = f"{number_of(len(session.runs), 'run')} of {number_of(len(session.scenarios), 'power cycle')}{days}"
    first = f"{runs}, axis {session.axis}, {session.sample_rate_hz:g} Hz"
    known = [f"{run.file}: {run.face}, axis {run.axis}, {_known(run)}" for run in session.runs]
    return "\n".join([first + (f", {session.sensor}" if session.sensor else ""), *known])


def _known(run: Any) -> str:
    if run.table_rate_dps is not None:
        return f"{run.table_rate_dps:g} dps"
    return f"{run.turn_deg:g} deg in all" if run.turn_deg is not None else "a measured reference"


def _session_table(session: Session) -> pl.DataFrame:
    """Every sample of every run."""
    frames = [run.table.select(pl.lit(run.file).alias("file"), pl.all()) for run in session.runs]
    return pl.concat(frames, how="diagonal")


def _comparison_words(found: Comparison) -> str:
    unit = level_unit(found)
    levels = ", ".join(f"{word} {unit.text(getattr(found.pooled, name))} {unit.name}" for name, word in LEVELS.items())
    if found.angles is not None:
        v = found.angles.level()
        levels = f"rms {deg(v.rms_deg)} deg, noise floor {deg(v.floor_deg)} deg, excess {deg(v.excess_deg)} deg"
    where = [f"{f.axis} against {f.against.replace('_', ' ')}: {f.note} ({f.strength:.1f} sigma)" for f in found.where]
    if is_high(found.to_json(), "dps" if found.angles is None else "deg"):
        levels += FLOOR_ABOVE
    return "\n".join([f"{found.verdict}; {levels}", headline(found), *where, *([found.note] if found.note else [])])


def _comparison_table(found: Comparison) -> pl.DataFrame:
    """Levels of each axis and of all together, deg/s."""
    levels = [*found.per_axis.items(), ("all", found.pooled)]
    keys = (*LEVELS, "excess_se_dps", "excess_within_dps")
    return _table([{"axis": axis} | {key: getattr(level, key) for key in keys} for axis, level in levels])


def _diagnosis_words(found: Diagnosis) -> str:
    named = [f"{c.decision}: {c.effect.title} on {c.axis}" for c in found.candidates if c.decision in ("add", "suggest")]
    return "\n".join([f"{found.verdict}; {verdict_text(found)}", *named])


def _diagnosis_table(found: Diagnosis | gravity_diagnosis.Diagnosis) -> pl.DataFrame:
    """One row for each candidate, best first; one that would be added but cannot be told from its group is ``ambiguous``."""
    keys = (
        "effect", "axis", "decision", "probability", "heldout_gain", "heldout_gain_se", "q_value", "explained", "group",
        "next_measurement",
    )  # fmt: skip
    rows = []
    for c in found.candidates:
        told = c.to_json() | ({"decision": "ambiguous"} if c.decision == "add" and not c.named else {})
        rows.append({key: told[key] for key in keys})
    return _table(rows)


def _diagnosis_figure(found: Diagnosis | gravity_diagnosis.Diagnosis) -> Figure:
    """What each candidate gains held out, with its standard error; those to add are blue."""
    rows = [c for c in found.candidates if c.gain is not None][::-1]
    figure = new_figure(8, 1 + 0.3 * max(1, len(rows)))
    axes = figure.subplots()
    for place, c in enumerate(rows):
        axes.errorbar(c.gain, place, xerr=c.gain_se or 0.0, fmt="o", color="C0" if c.decision == "add" else "0.5")  # type: ignore[arg-type]
    axes.set_yticks(range(len(rows)), [f"{c.effect.id} on {c.axis}: {c.decision}" for c in rows])
    axes.axvline(0, color="0.7")
    axes.set_xscale("symlog", linthresh=10)
    axes.set_xlabel("held-out gain in log-likelihood")
    axes.margins(x=0.08)
    axes.set_title(f"verdict: {found.verdict}")
    return figure


def _calibration_words(found: Calibration) -> str:
    trusted = sum(e.trusted for e in found)
    lines = [
        f"{e.axis} of {e.scenario}, {e.method}, from {from_words(e.taken)}: scale {_value(e.scale, e.scale_se)}, bias "
        f"{_value(e.bias_dps, e.bias_se_dps)} dps{'' if e.trusted else ' (' + ', '.join(e.flags) + ')'}"
        for e in found
    ]
    return "\n".join([f"{number_of(len(found), 'estimate')}, {trusted} trusted", *lines])


def _value(value: float | None, se: float | None) -> str:
    return "none" if value is None else plus_minus(value, se)


def _calibration_figure(found: Calibration) -> Figure:
    """Scale and bias with their standard errors, methods side by side; an estimate that is not trusted is hollow."""
    columns = list(dict.fromkeys((e.scenario, e.axis, cell(e.taken)) for e in found))
    methods = list(dict.fromkeys(e.method for e in found))
    figure = new_figure(max(8.0, 0.6 * len(columns)), 5)
    scale, bias = figure.subplots(2, 1, sharex=True)
    for e in found:
        place = columns.index((e.scenario, e.axis, cell(e.taken))) + 0.15 * (methods.index(e.method) - (len(methods) - 1) / 2)
        style: dict[str, Any] = {"fmt": "o", "color": f"C{methods.index(e.method)}", "mfc": None if e.trusted else "white"}
        for axes, value, se in ((scale, e.scale, e.scale_se), (bias, e.bias_dps, e.bias_se_dps)):
            if value is not None:
                axes.errorbar(place, value, yerr=se or 0.0, **style)
    for method in methods:
        scale.plot([], [], "o", color=f"C{methods.index(method)}", label=method)
    scale.legend(title="hollow: not trusted", fontsize=8, title_fontsize=8)
    scale.set_ylabel("scale")
    bias.set_ylabel("bias, dps")
    bias.set_xticks(range(len(columns)), [f"{scenario} {axis}\n{taken}" for scenario, axis, taken in columns], fontsize=7)
    return figure


def _steps_table(found: Explanation | gravity_diagnosis.Explanation) -> pl.DataFrame:
    """One row for each step; the candidates that are left are those of ``found.last``."""
    empty = {"effects": pl.List(pl.String), "axes": pl.List(pl.String)}
    return _table([step.to_json() for step in found.steps]) if found.steps else pl.DataFrame(schema=empty)


def _model_words(model: Model) -> str:
    rows = _model_rows(model)
    lines = [f"{r['effect']} on {r['axis']}: {r['parameter']} = {_value(r['value'], r['se'])}" for r in rows]
    return "\n".join([f"{model.name}: {', '.join(model.ids)}", *lines])


def _model_rows(model: Model) -> list[dict[str, Any]]:
    return [
        {"effect": line.id, "axis": line.axis, "parameter": name, "value": value, "se": line.se.get(name)}
        for line in model.lines()
        for name, value in line.values.items()
    ]


def _model_table(model: Model) -> pl.DataFrame:
    """One row for each fitted parameter."""
    schema = {"effect": pl.String, "axis": pl.String, "parameter": pl.String, "value": pl.Float64, "se": pl.Float64}
    return pl.DataFrame(_model_rows(model), schema=schema)


def _model_figure(model: Model) -> Figure:
    """Each fitted parameter over its standard error, on a scale that is linear near 0; its value stands beside it."""
    rows = [row for row in _model_rows(model) if row["se"]][::-1]
    figure = new_figure(8, 1 + 0.3 * max(1, len(rows)))
    axes = figure.subplots()
    axes.axvspan(-2, 2, color="0.9")
    for place, row in enumerate(rows):
        axes.errorbar(row["value"] / row["se"], place, xerr=1.0, fmt="o", color="C0")
        axes.annotate(
            plus_minus(row["value"], row["se"]), (1.01, place), xycoords=("axes fraction", "data"), va="center", fontsize=8,
        )  # fmt: skip
    axes.set_yticks(range(len(rows)), [f"{row['effect']} {row['axis']} {row['parameter']}" for row in rows])
    axes.set_xscale("symlog", linthresh=10)
    axes.margins(x=0.08)
    axes.set_xlabel("value over its standard error (grey: not different from 0)")
    return figure


def _plan_words(plan: Plan) -> str:
    named = [f"{run.scenario}: {words(run)}, {run.seconds:g} s" for run in plan.runs]
    return "\n".join([promise(plan), plan.question.why, *([plan.advice] if plan.advice else []), *named])


def _plan_figure(plan: Plan) -> Figure:
    """The rate of the table over the recorded minutes; chamber temperatures beside the runs."""
    figure = new_figure(8, 3)
    axes, start_min = figure.subplots(), 0.0
    for run in plan.runs:
        stop_min = start_min + run.seconds / 60
        axes.plot([start_min, stop_min], [run.table_rate_dps] * 2, color="C0" if run.face == "up" else "C1", linewidth=3)
        if run.temp_c is not None:
            axes.annotate(f"{run.temp_c:g} °C", (start_min, run.table_rate_dps), fontsize=6)
        start_min = stop_min
    axes.set_xlabel("recorded time, min")
    axes.set_ylabel("table, dps (blue: face up)")
    return figure


def _angles_words(found: gravity.Comparison) -> str:
    level = found.pooled
    levels = f"rms {deg(level.rms_deg)} deg, noise floor {deg(level.floor_deg)} deg, excess {deg(level.excess_deg)} deg"
    where = [f"{f.axis} against {f.against.replace('_', ' ')}: {f.note} ({f.strength:.1f} sigma)" for f in found.where]
    if is_high(found.to_json(), "deg"):
        levels += FLOOR_ABOVE
    return "\n".join([f"{found.verdict}; {levels}", by_gravity.headline(found), *where, *([found.note] if found.note else [])])


def _angles_table(found: gravity.Comparison) -> pl.DataFrame:
    """Levels of the movements about each axis and of all together, deg."""
    return _table([{"axis": axis} | level.to_json() for axis, level in [*found.per_axis.items(), ("all", found.pooled)]])


def _angles_figure(found: gravity.Comparison) -> Figure:
    """Rms and noise floor of the movements about each axis."""
    figure = new_figure(8, 2)
    axes = figure.subplots()
    for place, level in enumerate(found.per_axis.values()):
        axes.barh(place, level.rms_deg or 0.0, color="C0", height=0.6)
        axes.barh(place, level.floor_deg or 0.0, color="0.5", height=0.6)
    axes.set_yticks(range(len(found.per_axis)), [f"about {axis}" for axis in found.per_axis])
    axes.set_xlabel("rms of held-out movements, deg (grey: noise floor)")
    return figure


def _named_words(found: gravity_diagnosis.Diagnosis) -> str:
    named = [f"{c.decision}: {c.effect.title} on {c.axis}" for c in found.candidates if c.decision in ("add", "suggest")]
    return "\n".join([f"{found.verdict}; {by_gravity.headline(found.comparison)}", *named])


def _added_words(found: gravity_diagnosis.Explanation) -> str:
    steps = [
        f"{', '.join(s.effects)} on {', '.join(s.axes)}: excess {deg(s.before.pooled.excess_deg)} deg before, "
        f"{deg(s.after.pooled.excess_deg)} after" for s in found.steps
    ]  # fmt: skip
    return "\n".join([f"{found.verdict}; {by_gravity.headline(found.last.comparison)}", *steps])


VIEWS.update({
    gravity.Comparison: View(_angles_words, _angles_table, _angles_figure),
    gravity_diagnosis.Diagnosis: View(_named_words, _diagnosis_table, _diagnosis_figure),
    gravity_diagnosis.Explanation: View(_added_words, _steps_table, lambda e: _angles_figure(e.last.comparison)),
    Session: View(_session_words, _session_table, preview),
    Comparison: View(_comparison_words, _comparison_table, pictures.levels),
    Diagnosis: View(_diagnosis_words, _diagnosis_table, _diagnosis_figure),
    Explanation: View(explanation.words, _steps_table, lambda e: pictures.levels(e.last.comparison)),
    Calibration: View(_calibration_words, lambda found: _table([e.to_json() for e in found]), _calibration_figure),
    Plan: View(_plan_words, lambda plan: _table([asdict(run) for run in plan.runs]), _plan_figure),
    Model: View(_model_words, _model_table, _model_figure),
    Fit: View(lambda f: _model_words(f.model), lambda f: _model_table(f.model), lambda f: _model_figure(f.model)),
})  # fmt: skip
