"""What a file or a folder holds: a session, a model, a plan, or a log of somebody else."""

from __future__ import annotations

import json
import tomllib
from dataclasses import asdict
from pathlib import Path
from typing import Any

from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.files import UNREADABLE
from gyrocal.present.output import plus_minus, stdout, table
from gyrocal.recording.column_map import Scaling
from gyrocal.recording.guess import guess
from gyrocal.recording.header import folder_of
from gyrocal.recording.mapped import data_file, files_of, is_log, source_of
from gyrocal.recording.plan_file import PlannedRuns
from gyrocal.recording.session import AXES, Session
from gyrocal.units import number_of

PLAN = "gyrocal-plan"
"""What the format of a plan begins with."""


def holds(source: Path) -> dict[str, Any]:
    """What lies there; ``kind`` is session, sessions, model, plan, json or log. Raises InputError if it is none of these."""
    path = folder_of(source)
    inside = _sessions_in(path)
    if inside:
        return {"kind": "sessions", "sessions": inside}
    if path.suffix == ".json" and path.is_file():
        return _json(path)
    if not is_log(path):
        return _session(Session.open(path))
    if path.suffix == ".toml":
        return _plan(path) if _format(path).startswith(PLAN) else _model(Model.open(path))
    return _log(path)


def _sessions_in(path: Path) -> list[str]:
    """The names of the sessions in a folder that is none itself, as ``fleet fit`` and ``calibrate --history`` take it."""
    if not path.is_dir() or (path / "session.toml").is_file():
        return []
    return sorted(p.name for p in path.iterdir() if (p / "session.toml").is_file())


def _json(path: Path) -> dict[str, Any]:
    """A truth of ``simulate``, or what a verb printed with ``--json``."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (*UNREADABLE, ValueError) as error:
        raise InputError(f"{path}: no JSON: {error}") from None
    return {"kind": "json", "keys": sorted(content) if isinstance(content, dict) else []}


def _format(path: Path) -> str:
    try:
        return str(tomllib.loads(path.read_text(encoding="utf-8")).get("format"))
    except UNREADABLE:
        return ""  # the reader of a model says what is wrong


def _session(session: Session) -> dict[str, Any]:
    runs = [
        {"file": r.file, "scenario": r.scenario, "face": r.face, "axis": r.axis, "table_rate_dps": r.table_rate_dps,
         "turn_deg": r.turn_deg, "samples": len(r), "seconds": r.duration_s}
        for r in session.runs
    ]  # fmt: skip
    columns = list(dict.fromkeys(name for run in session.runs for name in run.table.columns))
    return {
        "kind": "session", "sensor": session.sensor, "axis": session.axis, "sample_rate_hz": session.sample_rate_hz,
        "columns": columns, "runs": runs,
    }  # fmt: skip


def _model(model: Model) -> dict[str, Any]:
    accelerometer = None if model.accelerometer is None else model.accelerometer.to_json()
    return {
        "kind": "model", "name": model.name, "model": model.ids, "parameters": model.values_json(),
        "accelerometer": accelerometer,
    }  # fmt: skip


def _plan(path: Path) -> dict[str, Any]:
    return {"kind": "plan", "runs": [asdict(run) for run in PlannedRuns.open(path).runs]}


def _log(path: Path) -> dict[str, Any]:
    sources = [source_of(files) for files in files_of(data_file(path))]
    columns = list(dict.fromkeys(name for source in sources for name in source.frame.columns))
    found: dict[str, Any] = {"kind": "log", "rows": sum(source.frame.height for source in sources), "columns": columns}
    try:
        guessed = guess(sources[0], Scaling())
        question = next((g.question for g in guessed if g.asks), None)
        return found | {"guessed": [g.map for g in guessed], "unknown": question}
    except InputError as error:
        return found | {"guessed": [], "unknown": str(error)}


def print_held(source: Path, found: dict[str, Any]) -> None:
    """What :func:`holds` has found, in words."""
    kind = found["kind"]
    if kind == "log":
        stdout.print(f"{source}: a log of {number_of(found['rows'], 'row')} with the columns {', '.join(found['columns'])}")
        if found["guessed"]:
            stdout.print("gyrocal import would take: " + " ".join(f"--map '{g}'" for g in found["guessed"]))
        if found["unknown"]:
            stdout.print(found["unknown"], markup=False)
    elif kind == "model":
        stdout.print(f"{source}: a model, {found['name']}")
        rows = [[p["effect"], p["axis"], p["name"], _value(p["value"], p["se"])] for p in found["parameters"]]
        if found["accelerometer"] is not None:
            rows += _accelerometer_rows(found["accelerometer"])
        table("", ["effect:", "axis:", "parameter:", "value"], rows)
    elif kind == "sessions":
        stdout.print(f"{source}: a folder of {number_of(len(found['sessions']), 'session')}: {', '.join(found['sessions'])}")
        stdout.print("Several boards: gyrocal fleet fit. One board over months: gyrocal calibrate --history.")
    elif kind == "json":
        stdout.print(f"{source}: JSON with the keys {', '.join(found['keys']) or '(none)'}; no recording and no model")
    elif kind == "plan":
        stdout.print(f"{source}: a plan of {number_of(len(found['runs']), 'run')}")
        names = list(found["runs"][0]) if found["runs"] else []
        table("", [f"{name}:" for name in names], [[_cell(value) for value in run.values()] for run in found["runs"]])
    else:
        about = f"axis {found['axis']}, {found['sample_rate_hz']:g} Hz, {found['sensor'] or 'no sensor named'}"
        runs = number_of(len(found["runs"]), "run")
        stdout.print(f"{source}: a session of {runs}, {about}; columns {', '.join(found['columns'])}")
        names = ["file", "scenario", "face", "axis", "table_rate_dps", "turn_deg", "samples", "seconds"]
        table("", [f"{name}:" for name in names], [[_cell(run[name]) for name in names] for run in found["runs"]])


def _value(value: float, se: float | None) -> str:
    return f"{value:.6g}" if se is None else plus_minus(value, se)


def _accelerometer_rows(found: dict[str, Any]) -> list[list[str]]:
    """Scale and bias of the accelerometer, and what an axis reads of the acceleration along another one."""
    rows = []
    for i, axis in enumerate(AXES):
        parts = {"scale": (found["scale"], found["scale_se"]), "bias_g": (found["bias_g"], found["bias_se_g"])}
        rows += [["accelerometer", axis, name, _value(values[axis], se[axis])] for name, (values, se) in parts.items()]
        cross = zip(found["matrix"][i][:i], found["matrix_se"][i][:i], strict=True)
        rows += [["accelerometer", axis, f"of {AXES[j]}", _value(value, se)] for j, (value, se) in enumerate(cross)]
    return rows


def _cell(value: Any) -> str:
    return "" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
