"""The whole story of a session and its model as one self-contained HTML file."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from typing import Any

import numpy as np

from gyrocal.api import Comparison, Session
from gyrocal.effects import base
from gyrocal.inference.fitted import Fit
from gyrocal.present import pictures, probability
from gyrocal.present.page import render
from gyrocal.present.report import PARAMETERS, WHERE, headline, judged_by, judged_rows, level_columns, parameter, where_rows
from gyrocal.present.verdict import stands_on
from gyrocal.units import CELSIUS, to_read, unit_of
from gyrocal.web.pictures import answer_table as answers
from gyrocal.web.pictures import charts, scatter
from gyrocal.web.pictures.effect_figure import effect_figure
from gyrocal.web.pictures.excess_chart import blocks
from gyrocal.web.pictures.small_picture import checks_svg
from gyrocal.web.pictures.words import evidence, method, unseen
from gyrocal.web.values.excess_by_step import Fall
from gyrocal.web.values.story import Change, in_doubt
from gyrocal.web.values.views import CalibrationView, DiagnosisView

CORRELATED = 0.3
"""Correlations of less are not listed."""
UNITS = {"_dps_per_c": f"dps/{CELSIUS}", "_dps": "dps", "_deg": "deg", "_c": CELSIUS, "_g": "g", "_hz": "Hz", "_s": "s"}
"""Units by the ends of names, for parameters that no effect declares."""


def page(
    name: str, found: Comparison, fall: Fall | None, story: Sequence[Change], diagnosis: DiagnosisView | None,
    calibration: CalibrationView | None, left_out: Sequence[str] = (),
) -> str:  # fmt: skip
    """The report as HTML text.

    ``diagnosis`` is that of the model that the report is about, and None if it was not diagnosed. ``left_out`` are the files of
    the runs that are left out of every fit.
    """
    compared, session = found.to_json(), found.fit.session
    drawn = [
        ("Residual against time", pictures.png_data(pictures.residual_against_time(found))),
        *((title, pictures.png_data(figure)) for title, figure in pictures.of_spectra(found).values()),
        ("Allan deviation", pictures.png_data(pictures.allan(found))),
    ]
    bars = [] if fall is None else blocks(charts.LIGHT, fall.bars, fall.unit)
    open_cards = [] if diagnosis is None else diagnosis.named
    return render(
        "web/report.html", name, headline(found), found.verdict == "adequate", found.warnings,
        facts=_facts(session, left_out), held_out=found.held_out, levels=judged_rows(found), level_columns=level_columns(found),
        where=where_rows(found), where_columns=WHERE, pictures=drawn, bars=bars,
        top=max((b.high for b in bars), default=1.0) or 1.0, fall=fall, story=story, missing=open_cards,
        missing_said="" if diagnosis is None else diagnosis.sentence,
        left_over="" if diagnosis is None else diagnosis.left_over, sets=[] if diagnosis is None else diagnosis.sets,
        set_columns=probability.SETS,
        adequate_said=found.verdict == "adequate", parameters=_parameters(compared["parameters"]), parameter_columns=PARAMETERS,
        correlations=[row for axis in found.fit.axes for row in correlated(found.fit, axis)],
        toml=found.fit.model.toml(), runs=_runs(session), calibration=calibration, commands=_commands(name, story, left_out),
        scattered=[] if calibration is None else scatter.sentences(calibration.estimates, session.axis),
        meanings=[] if calibration is None else scatter.meanings(calibration.estimates), stands_on=stands_on(compared),
        evidence=evidence, unseen=unseen, columns=columns, judged_by=judged_by(found), doubted=in_doubt(story),
        checks_of=lambda card: checks_svg((card.judged.get("checks") or {}).get("share"), card.halves),
        drawn=lambda shown: pictures.png_data(effect_figure(shown)), **_answers(calibration),
    )  # fmt: skip


def _facts(session: Session, left_out: Sequence[str]) -> list[tuple[str, str]]:
    """What was measured, in rows of name and value."""
    runs = session.runs
    seconds = sum(run.duration_s for run in runs)
    days = sorted({run.day for run in runs if run.day is not None})
    warmth = [t for run in runs if (t := run.column("temp_c")) is not None]
    rows = [
        ("sensor", session.sensor or "not stated"),
        ("made on", session.made_on or "not stated"),
        ("axis", f"{session.axis}, {session.sample_rate_hz:g} samples a second"),
        ("runs", f"{len(runs)} in {len(session.scenarios)} power cycles, {seconds:.0f} s, {sum(map(len, runs)):,} samples"),
    ]
    if days:
        rows.append(("days", ", ".join(map(str, days))))
    if warmth:
        low, high = min(float(np.nanmin(t)) for t in warmth), max(float(np.nanmax(t)) for t in warmth)
        rows.append(("temperature", f"{low:.1f} to {high:.1f} °C"))
    if left_out:
        rows.append(("left out of every fit", ", ".join(sorted(left_out))))
    return rows


def _runs(session: Session) -> list[list[str]]:
    """File, power cycle, day, face, axis, rate and length of each run."""
    rows = []
    for run in session.runs:
        rate = "by a reference" if run.table_rate_dps is None else f"{run.table_rate_dps:g}"
        if run.turn_deg is not None:
            rate = f"turned by {run.turn_deg:g} deg"
        day = "" if run.day is None else str(run.day)
        rows.append([run.file, run.scenario, day, run.face, run.axis, rate, f"{run.duration_s:.1f}"])
    return rows


def _parameters(parameters: Sequence[dict[str, Any]]) -> list[list[str]]:
    """The rows below ``PARAMETERS``."""
    kinds = base.effects()

    def unit(effect: str, name: str) -> str:
        declared = {p.name: to_read(p.unit) for p in kinds[effect].parameters} if effect in kinds else {}
        known = declared.get(name) or declared.get(name.removesuffix("_sd"))
        return known or next((u for end, u in UNITS.items() if name.endswith(end)), "")

    return [
        [p["effect"], p["axis"], p["name"], *parameter(p["value"], p["se"], unit(p["effect"], p["name"]))] for p in parameters
    ]


def columns(text: str) -> int:
    """The length of the longest line of a file that must not be broken, as a comment may be."""
    return max((len(line) for line in text.splitlines() if not line.startswith("#")), default=1)


def _answers(found: CalibrationView | None) -> dict[str, Any]:
    """What the template shows of scale and bias: the answers, and how far those of the first seconds are from all seconds."""
    estimates, errors = ([], {}) if found is None else (found.estimates, found.errors)
    unit = unit_of(e["bias_dps"] for e in estimates)
    apart = [
        [method(name), f"{s:g}", f"{100 * scale:.4f}", unit.text(bias_dps, 3)]
        for name, by in errors.items() for s, (scale, bias_dps) in by.items()
    ]  # fmt: skip
    return {"bias_unit": unit, "apart": apart, "answer_columns": answers.columns(unit), "answers": answers.rows(estimates)}


def correlated(fitted: Fit, axis: str) -> list[list[str]]:
    """Linear parameters of an axis that depend on each other: axis, both names as effect.parameter, and their correlation."""
    table = fitted.correlations(axis)
    names = list(table["parameter"])
    of = table.drop("parameter").to_numpy()
    pairs = [(j, i) for i in range(len(names)) for j in range(i) if abs(of[i, j]) > CORRELATED]  # NaN: a fixed one
    return [[axis, names[j], names[i], f"{of[i, j]:+.2f}"] for j, i in pairs]


def _commands(name: str, story: Sequence[Change], left_out: Sequence[str]) -> list[str]:
    """The command lines that repeat what the report shows, without the files of the runs that are left out."""
    shown = f"{name}-shown" if left_out else name
    session = shlex.quote(shown)
    without = (
        f"from gyrocal.api import Session; s = Session.open({name!r}); "
        f"s.with_runs([r for r in s.runs if r.file not in {sorted(left_out)!r}]).save({shown!r})"
    )
    copied = [f"python -c {shlex.quote(without)}"] if left_out else []
    first = [*copied, f"gyrocal compare {session}", f"gyrocal diagnose {session}"]
    if not story:
        return [*first, f"gyrocal calibrate {session} --model default"]
    changes = [change.command(session) for change in story]
    last = [f"gyrocal {verb} {session} --model model.toml" for verb in ("compare", "calibrate")]
    return [*first, *changes, *last]
