"""Apply a model to a recording: a session folder, or any log that can be imported, with corrected readings.

The bias changes with each power cycle, so the model's bias is only its mean over the power cycles of its session. ``bias`` says
where this power cycle's bias comes from: ``model``, ``rest:S`` (the mean of the first S seconds of a run that is at rest in
them), or a file with the output of ``gyrocal calibrate --json``.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite
from pathlib import Path
from typing import Any

import polars as pl

from gyrocal.calibration.at_rest import biases_at_rest
from gyrocal.calibration.beyond import Beyond, beyond, columns_of, warned
from gyrocal.error_model.accelerometer import ACCELERATIONS
from gyrocal.error_model.correction import RATES, Corrected, correct, run_of
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.files import LARGEST_JSON_BYTES, UNREADABLE, read_small_text, replacing, why_unreadable
from gyrocal.plausibility.header import corrected_otherwise
from gyrocal.recording.header import folder_of
from gyrocal.recording.import_options import Options
from gyrocal.recording.importer import Imported, read_recording
from gyrocal.recording.mapped import is_log
from gyrocal.recording.session import AXES, Run, Session
from gyrocal.recording.table import read_table, write_table
from gyrocal.warning import Warning

TABLES = (".csv", ".csv.gz", ".parquet")
LONGEST_HEADER = 65536
"""Characters of a first line, in which the names of columns are looked for."""


@dataclass(frozen=True)
class Applied:
    """What :func:`apply` did: the number of rows, the effects that it removed, and the others with the reason.

    ``outside`` are the rows beyond what the model was fitted on, by variable.
    """

    rows: int
    applied: list[str]
    left: dict[str, str]
    outside: dict[str, int] = field(default_factory=dict)
    warnings: list[Warning] = field(default_factory=list)
    accelerometer: bool = False
    """True if the accelerations were corrected too."""

    def to_json(self) -> dict[str, Any]:
        return {
            "rows": self.rows, "applied": self.applied,
            "left": [{"effect": effect, "why": why} for effect, why in self.left.items()],
            "outside": self.outside, "accelerometer": self.accelerometer,
            "warnings": [warning.to_json() for warning in self.warnings],
        }  # fmt: skip


def refuse_guess(log: Imported) -> None:
    """Raise InputError if columns of a log were guessed; the guess is in the error, as ``maps`` takes it."""
    if log.guessed:
        guess = " ".join(f"{g.option} '{g.map}'" for g in log.guessed)
        raise InputError(f"{log.first_rows[0].file}: its columns are not mapped; a guess: {guess}")


def apply(
    source: str | Path, model: Model | str | Path, out: str | Path, bias: str = "model", maps: Sequence[str] = (), *,
    confirm: Callable[[Imported], None] = refuse_guess, **options: Any,
) -> Applied:  # fmt: skip
    """Write the recording ``source`` to ``out`` with the model's effects removed from its readings.

    A session folder gives a session. Any log that can be imported gives a table (``.csv``, ``.csv.gz`` or ``.parquet``) with
    the columns of a session and no true rate. A table that has these columns itself is taken as it is: its times, references
    and all other columns stay.

    Args:
        source: a session folder, or a log.
        model: the model with fitted values, or its file.
        out: what is written; it must not exist.
        bias: where this power cycle's bias comes from: ``model``, ``rest:S`` or the output of ``gyrocal calibrate --json``.
        maps: ``target=column[:unit][*factor]`` for a log, as for ``import_recording``.
        confirm: called with a log before it is corrected; by default it refuses one whose columns were guessed.
        options: how a log is read, by the names of :meth:`Options.of`, for example ``topic``, ``rate_hz`` or ``lsb_dps``.

    Raises:
        InputError: the recording cannot be read, the model has no values, ``out`` exists, or ``bias`` cannot be used.
    """
    path, target, opened = folder_of(Path(source)), Path(out), Model.open(model)
    if target.exists():
        raise InputError(f"{target}: exists already; choose another name for --out or remove it")
    options = {name: value for name, value in options.items() if value is not None}
    mapped = bool(maps or options)
    if not mapped and not is_log(path):
        session = Session.open(path)
        runs, done = _corrected(session.runs, opened, bias)
        # corrected readings are no whole counts and may exceed the full scale
        replace(session.with_runs(runs), lsb_dps=None, full_scale_dps=None).save(target)
        return done
    if not target.name.endswith(TABLES):
        endings = f"{', '.join(TABLES[:-1])} or {TABLES[-1]}"
        raise InputError(f"{target}: logs are corrected into tables that end in {endings}; give --out such a name")
    if not mapped and _has_the_columns_of_a_session(path):
        log = Log(read_table(path))
    else:
        log = _read_log(path, Options.of(maps, options), opened, confirm)
    runs, done = _corrected((run_of(log.frame, path.name),), opened, bias)
    try:
        with replacing(target) as partial:
            write_table(runs[0].table.select(c for c in log.frame.columns if c not in log.unmeasured), partial)
    except OSError as error:
        raise InputError(f"{target}: {error.strerror}") from None
    return replace(done, warnings=[*log.warnings, *done.warnings])


@dataclass(frozen=True)
class Log:
    """A log as a table with the columns of a session. ``unmeasured`` are the rates that it lacks, at the model's bias."""

    frame: pl.DataFrame
    unmeasured: tuple[str, ...] = ()
    warnings: tuple[Warning, ...] = ()


def _has_the_columns_of_a_session(path: Path) -> bool:
    """True for a CSV or Parquet table whose header has the columns that every table of a session has."""
    try:
        if path.suffix == ".parquet":
            names = list(pl.read_parquet_schema(path))
        elif path.suffix == ".csv":
            with path.open(encoding="utf-8-sig", errors="replace") as file:
                names = [name.strip() for name in file.readline(LONGEST_HEADER).split(",")]
        else:
            return False
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException):
        return False
    return {"t_s", *RATES} <= set(names)


def _read_log(path: Path, options: Options, model: Model, confirm: Callable[[Imported], None]) -> Log:
    """The table of a log. A rate that it does not measure stands at the model's bias: as if nothing turned about that axis."""
    found = read_recording(path, replace(options, needs_rate=False))
    if len(found.session.runs) > 1:
        raise InputError(f"{path}: it holds {len(found.session.runs)} recordings; correct one at a time")
    confirm(found)
    targets = {taken.target for taken in found.first_rows}
    unmeasured = tuple(name for name in RATES if name not in targets)
    at_bias = [pl.lit(model.bias_dps.get(axis, 0.0)).alias(f"g{axis}_dps") for axis in AXES if f"g{axis}_dps" in unmeasured]
    warnings = (*found.warnings, *corrected_otherwise(found.session.corrected, model.fitted_on.corrected))
    return Log(found.session.runs[0].table.with_columns(at_bias), unmeasured, warnings)


def _corrected(runs: tuple[Run, ...], model: Model, bias: str) -> tuple[list[Run], Applied]:
    known = _Biases(model, runs, bias)
    out, results, quantities = [], [], []
    for run in runs:
        done = correct(model, run, known.of(run))
        columns = [pl.Series(name, done.rate_dps[:, i]) for i, name in enumerate(RATES)]
        columns += [] if model.accelerometer is None else model.accelerometer.corrected(run.table)
        out.append(replace(run, path=None, frame=run.table.with_columns(columns), lsb_dps=None))
        results.append(done)
        quantities.append(columns_of(run, done.rate_dps))
    summary = _summary(results, model, beyond(model, quantities))
    whole = model.accelerometer is not None and all(set(ACCELERATIONS) <= set(run.table.columns) for run in runs)
    return out, replace(summary, accelerometer=whole)


def _summary(results: list[Corrected], model: Model, found: Beyond) -> Applied:
    """The result over all runs. An effect counts as applied if it was removed from every run."""
    left = {effect: why for r in results for effect, why in r.left.items()}
    applied = [i for i in dict.fromkeys(i for r in results for i in r.applied) if all(i in r.applied for r in results)]
    return Applied(sum(len(r.rate_dps) for r in results), applied, left, dict(found.rows), warned(model, found))


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
