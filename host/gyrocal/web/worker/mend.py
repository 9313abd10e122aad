"""Ways to mend a session that a warning speaks of. Nothing is written before the user confirms it."""

from __future__ import annotations

import shutil
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import polars as pl

from gyrocal.errors import InputError
from gyrocal.recording.header import read_header, write_header
from gyrocal.recording.run import Run
from gyrocal.recording.session import Session
from gyrocal.web.values.views import RunView

KEPT_AS = "session.toml.before"
"""The name under which the file that the user wrote is kept when it is first changed."""
DEG_PER_RAD = 180 / np.pi
MOST_RATES = 3
"""Rates that are listed before "and so on"."""

Kind = Literal["face", "sign", "units", "drop_first", "accept", "leave_out"]


@dataclass(frozen=True)
class Mend:
    """One way to mend a session: ``label`` is on its button, ``told`` says before it is done what will be written."""

    kind: Kind
    label: str
    told: str
    code: str
    axis: str | None
    file: str | None


def mends(warning: dict[str, Any], runs: Sequence[RunView], last_run: str | None = None) -> list[Mend]:
    """The ways to mend what a warning of ``--json`` speaks of, the surest first; empty if only the user can.

    ``runs`` are those of the session. ``last_run`` is the file of the only run in the fits, which is not left out; None if
    there are several.
    """
    code, axis, file = warning["code"], warning["axis"], warning["file"]
    which = file or ("every run" if axis is None else f"every run about {axis}")
    meant = [run for run in runs if file in (None, run.file) and axis in (None, run.axis)]
    toml = f"session.toml (its present text is kept as {KEPT_AS})"
    kept = f"The present text of session.toml is kept as {KEPT_AS}."
    out = []

    def offer(kind: Kind, label: str, told: str) -> None:
        out.append(Mend(kind, label, told, code, axis, file))

    if code == "face_wrong":
        offer("face", f"Change the face of {which}", f"{_other_face(which, meant)} {kept}")
    if code == "sign_flipped":
        offer("sign", f"Reverse the rates of {which}", f"{_other_sign(which, meant)} {kept}")
    if code == "unit_rad_s":
        told = "A new session is written beside this one, in which what is in rad/s is in dps. It is then opened."
        offer("units", "Convert to dps", told)
    if code == "first_sample":
        runs_off = which if file else "each run that begins so"
        told = f"A new session is written beside this one, without the first samples of {runs_off}. It is then opened."
        offer("drop_first", f"Drop the first samples of {runs_off}", told)
    if file is not None and file != last_run:
        told = f"{file} is left out of the fits. The session's files stay as they are; the choice is kept in workbench.json."
        offer("leave_out", f"Leave {file} out", told)
    if warning["blocking"]:
        entry = code if axis is None else f"{code}:{axis}"
        offer("accept", "Accept it", f'accept = ["{entry}"] is written into {toml}. The warning stays, but no longer blocks.')
    return out


def _other_face(which: str, runs: Sequence[RunView]) -> str:
    """What another face of runs changes in session.toml, and what that says of the sensor on the table."""
    if len(runs) != 1:
        return (
            f'In session.toml, face = "up" of {which} becomes face = "down", and "down" becomes "up". This says that the '
            "sensor lay the other way up on the table: every table rate counts about its axis with the other sign than before. "
            "table_rate_dps stays as it is."
        )
    (run,) = runs
    new, points = ("down", "against") if run.face == "up" else ("up", "along")
    told = (
        f'In session.toml, face = "{run.face}" of {run.file} becomes face = "{new}". This says that the sensor lay face {new} '
        f"on the table, with its {run.axis} axis {points} the table's axis of rotation."
    )
    if run.rate_dps is None:
        return f"{told} A known turn of the table then counts with the other sign; a reference in the file stays as it is."
    if run.rate_dps == 0:
        return f"{told} It was at rest, so its true rate stays 0."
    rate_dps = run.rate_dps if new == "up" else -run.rate_dps
    return (
        f"{told} The table's {run.rate_dps:g} dps are then a true rate of {rate_dps:g} dps about {run.axis}, not "
        f"{-rate_dps:g}. table_rate_dps stays as it is."
    )


def _other_sign(which: str, runs: Sequence[RunView]) -> str:
    """What reversed rates change in session.toml, and what that says of the table."""
    rates = dict.fromkeys(run.rate_dps for run in runs if run.rate_dps)
    shown = ", ".join(f"{rate:g} becomes {-rate:g}" for rate in list(rates)[:MOST_RATES])
    told = f": {shown}{', and so on' if len(rates) > MOST_RATES else ''}" if rates else ""
    return (
        f"In session.toml, table_rate_dps of {which} is written with the other sign{told}. This says that the table turned the "
        "other way. face stays as it is."
    )


def apply(folder: Path, mend: Mend, out: Callable[[], Path]) -> Path:
    """Mend a session and return the folder to open: the same, or ``out()`` where the tables themselves change.

    Raises InputError if the session cannot be mended in this way.
    """
    if mend.kind == "units":
        return _in_degrees(folder, mend, out())
    if mend.kind == "drop_first":
        return _without_first(folder, mend, out())
    read_header(folder)
    path = folder / "session.toml"
    raw = tomllib.loads(path.read_text(encoding="utf-8"))
    runs = raw.pop("run")
    chosen = [r for r in runs if mend.file in (None, r["file"]) and mend.axis in (None, r.get("axis", raw.get("axis", "z")))]
    if mend.kind == "accept":
        entry = mend.code if mend.axis is None else f"{mend.code}:{mend.axis}"
        raw["accept"] = sorted({*raw.get("accept", []), entry})
    elif mend.kind == "face":
        for run in chosen:
            run["face"] = "down" if run["face"] == "up" else "up"
    elif mend.kind == "sign":
        stated = [run for run in chosen if "table_rate_dps" in run]
        if not stated:
            raise InputError(f"{path}: no run states table_rate_dps; negate the reference when importing (*-1)")
        for run in stated:
            run["table_rate_dps"] = -run["table_rate_dps"]
    if not (folder / KEPT_AS).exists():
        shutil.copyfile(path, folder / KEPT_AS)
    write_header(folder, raw, runs)
    return folder


def _in_degrees(folder: Path, mend: Mend, out: Path) -> Path:
    """Write the session with readings or reference in deg/s, whichever of them takes the warning away and brings no other."""
    from gyrocal.plausibility import check

    session = Session.open(folder)
    before = sum(w.blocking for w in check(session))
    for convert in (_readings, _reference):
        converted = session.with_runs([convert(run) for run in session.runs])
        found = check(converted)
        if sum(w.blocking for w in found) < before and not any(w.code == mend.code for w in found):
            converted.save(out)
            return out
    raise InputError(f"{folder}: neither readings nor reference agree in dps throughout; give the units when importing")


def _without_first(folder: Path, mend: Mend, out: Path) -> Path:
    """Write the session without the first samples that stand off what follows."""
    from gyrocal.plausibility.readings import clip_levels_dps, first_off
    from gyrocal.recording.register import registered

    session = Session.open(folder)
    known = registered(session)
    off = {file: n for file, n in first_off(known, clip_levels_dps(known)).items() if mend.file in (None, file)}
    session.with_runs([run.part(off[run.file], len(run)) if run.file in off else run for run in session.runs]).save(out)
    return out


def _readings(run: Run) -> Run:
    return _scaled(run, ("gx_dps", "gy_dps", "gz_dps"))


def _reference(run: Run) -> Run:
    rate, turn = (None if v is None else v * DEG_PER_RAD for v in (run.table_rate_dps, run.turn_deg))
    return replace(_scaled(run, ("rate_ref_dps", "ref_angle_deg")), table_rate_dps=rate, turn_deg=turn)


def _scaled(run: Run, columns: Sequence[str]) -> Run:
    there = [c for c in columns if c in run.table.columns]
    return replace(run, path=None, frame=run.table.with_columns(pl.col(there) * DEG_PER_RAD) if there else run.table)
