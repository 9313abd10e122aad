"""Apply a model to a recording: a session folder, a CSV or a Parquet table with corrected readings.

The bias changes with each power cycle, so the model's bias is only its mean over the power cycles of its session. ``bias`` says
where this power cycle's bias comes from: ``model``, ``rest:S`` (the mean of the first S seconds of a run that is at rest in
them), or a file with the output of ``gyrocal calibrate --json``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Any

import polars as pl

from gyrocal.calibration.at_rest import biases_at_rest
from gyrocal.error_model.correction import RATES, correct, run_of
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.files import LARGEST_JSON_BYTES, UNREADABLE, read_small_text, replacing, why_unreadable
from gyrocal.recording.session import AXES, Run, Session
from gyrocal.recording.table import read_table, write_table

TABLES = (".csv", ".parquet")


@dataclass(frozen=True)
class Applied:
    """What :func:`apply` did: the number of rows, the effects that it removed, and the others with the reason."""

    rows: int
    applied: list[str]
    left: dict[str, str]

    def to_json(self) -> dict[str, Any]:
        return {
            "rows": self.rows, "applied": self.applied,
            "left": [{"effect": effect, "why": why} for effect, why in self.left.items()],
        }  # fmt: skip


def apply(source: str | Path, model: Model | str | Path, out: str | Path, bias: str = "model") -> Applied:
    """Write the recording ``source`` to ``out`` with the model's effects removed from its readings.

    A folder is a session and gives a session; a ``.csv`` or ``.parquet`` file gives a table. Times, references and all other
    columns stay as they are. Raises InputError if the recording cannot be read, the model has no values, ``out`` exists, or
    ``bias`` cannot be used.
    """
    path, target, opened = Path(source), Path(out), Model.open(model)
    if target.exists():
        raise InputError(f"{target}: exists already; choose another name for --out or remove it")
    if path.is_dir():
        session = Session.open(path)
        runs, results = _corrected(session.runs, opened, bias)
        # corrected readings are no whole counts and may exceed the full scale
        replace(session.with_runs(runs), lsb_dps=None, full_scale_dps=None).save(target)
        return _summary(results)
    if path.suffix not in TABLES or target.suffix not in TABLES:
        raise InputError(f"{path} -> {target}: give a session folder, or tables that end in {' or '.join(TABLES)}")
    frame = read_table(path)
    runs, results = _corrected((run_of(frame, path.name),), opened, bias)
    try:
        with replacing(target) as partial:
            write_table(runs[0].table.select(frame.columns), partial)
    except OSError as error:
        raise InputError(f"{target}: {error.strerror}") from None
    return _summary(results)


def _corrected(runs: tuple[Run, ...], model: Model, bias: str) -> tuple[list[Run], list[Applied]]:
    known = _Biases(model, runs, bias)
    out, results = [], []
    for run in runs:
        done = correct(model, run, known.of(run))
        columns = [pl.Series(name, done.rate_dps[:, i]) for i, name in enumerate(RATES)]
        out.append(replace(run, path=None, frame=run.table.with_columns(columns), lsb_dps=None))
        results.append(Applied(len(run), done.applied, done.left))
    return out, results


def _summary(results: list[Applied]) -> Applied:
    """The result over all runs. An effect counts as applied if it was removed from every run."""
    left = {effect: why for r in results for effect, why in r.left.items()}
    applied = [i for i in dict.fromkeys(i for r in results for i in r.applied) if all(i in r.applied for r in results)]
    return Applied(sum(r.rows for r in results), applied, left)


class _Biases:
    """The bias of each power cycle by axis, deg/s, from the source that ``--bias`` names."""

    def __init__(self, model: Model, runs: tuple[Run, ...], bias: str) -> None:
        self.known: Mapping[str, dict[str, float]] = {}
        self.everywhere: dict[str, float] = {}
        if bias == "model":
            return
        if bias.startswith("rest:"):
            self.known = _at_rest(model, runs, bias)
            return
        self.known, self.everywhere = _from_calibration(Path(bias))

    def of(self, run: Run) -> dict[str, float]:
        return {**self.everywhere, **self.known.get(run.scenario, {})}


def _at_rest(model: Model, runs: tuple[Run, ...], bias: str) -> dict[str, dict[str, float]]:
    """The bias of each power cycle from the beginning of a run of it that is at rest there."""
    try:
        seconds = float(bias.removeprefix("rest:"))
    except ValueError:
        raise InputError(f"--bias {bias}: give seconds after rest:, for example rest:5") from None
    if not 0 < seconds < float("inf"):
        raise InputError(f"--bias {bias}: the seconds at rest must be more than 0")
    return biases_at_rest(model, runs, seconds)


def _from_calibration(path: Path) -> tuple[dict[str, dict[str, float]], dict[str, float]]:
    """Biases by scenario, and those that hold for all scenarios, from the JSON of ``gyrocal calibrate``.

    Of several estimates of one axis, trusted ones count, and of these the one with the smallest standard error.
    """
    try:
        estimates = json.loads(read_small_text(path, LARGEST_JSON_BYTES))["estimates"]
        usable = [e for e in estimates if e.get("bias_dps") is not None and e.get("trusted")]
        usable = [{**e, "bias_dps": float(e["bias_dps"]), "bias_se_dps": float(e.get("bias_se_dps") or "inf")} for e in usable]
        known = all(isinstance(e["scenario"], str) and e["axis"] in AXES and isfinite(e["bias_dps"]) for e in usable)
        if not known:
            raise ValueError("an estimate without a scenario, an axis or a bias")
    except OSError as error:
        raise InputError(f"--bias {path}: {error.strerror}; give model, rest:S or the JSON of `gyrocal calibrate`") from None
    except (*UNREADABLE, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"--bias {path}: not the JSON of `gyrocal calibrate --json`: {why_unreadable(error)}") from None
    if not usable:
        raise InputError(f"--bias {path}: it holds no estimate that can be trusted")
    usable.sort(key=lambda e: -e["bias_se_dps"])
    by_scenario: dict[str, dict[str, float]] = {}
    for e in usable:
        by_scenario.setdefault(e["scenario"], {})[e["axis"]] = e["bias_dps"]
    alone = next(iter(by_scenario.values())) if len(by_scenario) == 1 else {}
    return by_scenario, {**alone, **by_scenario.get("all", {})}
