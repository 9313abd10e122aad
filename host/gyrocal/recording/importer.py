"""Others' recordings into a session: tables of any column names and units, cut into runs.

A table is CSV (comma, semicolon, tab or space; lines of other text may stand above it; gzip or not) or Parquet.
Each wanted column is named by a mapping, ``target=column[:unit][*factor]``; see docs/importing.md.
"""

from __future__ import annotations

import fnmatch
import gzip
import io
import json
import math
import re
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from gyrocal.errors import InputError
from gyrocal.recording.session import (
    AXES,
    OPTIONAL,
    REQUIRED,
    Array,
    Run,
    RunEntry,
    Session,
    check_table,
    read_header,
    run_entry,
    write_header,
    write_table,
)
from gyrocal.warning import Warning

TARGETS = (*REQUIRED, *OPTIONAL)
HEADER_SEARCH_LINES = 200
STANDARD_GRAVITY = 9.80665
QUOTES = " \t\"'"

_TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_RATE = {"dps": 1.0, "deg/s": 1.0, "mdps": 1e-3, "rad/s": 180.0 / math.pi}
_ACCELERATION = {"g": 1.0, "mg": 1e-3, "m/s2": 1.0 / STANDARD_GRAVITY, "m/s^2": 1.0 / STANDARD_GRAVITY}
_ANGLE = {"deg": 1.0, "rad": 180.0 / math.pi, "turn": 360.0}
_TEMPERATURE = {"degC": (1.0, 0.0), "C": (1.0, 0.0), "K": (1.0, -273.15), "degF": (1 / 1.8, -32 / 1.8)}

EUROC = (
    "t_s=timestamp [ns]:ns",
    *(f"g{a}_dps=w_RS_S_{a} [rad s^-1]:rad/s" for a in AXES),
    *(f"a{a}_g=a_RS_S_{a} [m s^-2]:m/s2" for a in AXES),
)
FORMATS = {"euroc": EUROC}
"""Mappings of known forms; ``euroc``: ``imu0/data.csv`` of EuRoC and the data sets that copy it."""


@dataclass(frozen=True)
class Scaling:
    """What ``counts`` and ``samples`` mean in a file: size of one count, samples a second."""

    rate_hz: float | None = None
    lsb_dps: float | None = None
    lsb_g: float | None = None


@dataclass(frozen=True)
class ColumnMap:
    """One column to take: ``value = column * factor + offset``, in the target's own unit."""

    target: str
    column: str
    factor: float = 1.0
    offset: float = 0.0

    @staticmethod
    def parse(text: str, scaling: Scaling) -> ColumnMap:
        """Read ``target=column[:unit][*factor]``; ``/number`` divides. InputError says what is wrong."""
        target, equals, rest = text.partition("=")
        target = target.strip()
        if not equals or not rest.strip():
            raise InputError(f"--map {text}: want TARGET=COLUMN[:UNIT][*FACTOR], for example gx_dps=gyr_x:rad/s")
        if target not in TARGETS:
            raise InputError(f"--map {text}: no column {target!r} in a session; there are {', '.join(TARGETS)}")
        multiplier = 1.0
        tail = re.fullmatch(r"(.*\S)\s*([*/])\s*([-+]?[0-9.]+(?:[eE][-+]?\d+)?)", rest)
        if tail:
            rest = tail[1]
            try:
                multiplier = float(tail[3]) if tail[2] == "*" else 1.0 / float(tail[3])
            except (ValueError, ZeroDivisionError):
                multiplier = math.nan
            if not math.isfinite(multiplier) or multiplier == 0.0:
                raise InputError(f"--map {text}: {tail[2]}{tail[3]} is not a usable factor")
        column, unit = rest.strip(), None
        units = units_of(target, scaling)
        head, colon, last = column.rpartition(":")
        if colon and head and last.strip() in units:
            column, unit = head.strip(), last.strip()
        elif colon and head and re.fullmatch(r"[A-Za-z/^2]{1,7}", last.strip()):
            raise InputError(
                f"--map {text}: unit {last.strip()!r} is not known here; {target} takes {', '.join(units)}"
            )
        scale = units[unit] if unit is not None else (1.0, 0.0)
        if scale is None:
            raise InputError(
                f"--map {text}: the unit {unit} needs {'--rate-hz' if unit == 'samples' else _lsb(target)}"
            )
        return ColumnMap(target, column, scale[0] * multiplier, scale[1])


def units_of(target: str, scaling: Scaling) -> dict[str, tuple[float, float] | None]:
    """Units that a target takes: name -> (factor, offset), None where an option that gives its size is missing."""

    def counted(name: str, size: float | None) -> dict[str, tuple[float, float] | None]:
        return {name: None if size is None else (size, 0.0)}

    def plain(table: Mapping[str, float]) -> dict[str, tuple[float, float] | None]:
        return {name: (factor, 0.0) for name, factor in table.items()}

    if target == "t_s":
        return plain(_TIME) | counted("samples", None if scaling.rate_hz is None else 1.0 / scaling.rate_hz)
    if target == "temp_c":
        return dict(_TEMPERATURE)
    if target == "table_angle_deg":
        return plain(_ANGLE)
    if target.endswith("_dps"):
        return plain(_RATE) | counted("counts", scaling.lsb_dps)
    return plain(_ACCELERATION) | counted("counts", scaling.lsb_g)


def _lsb(target: str) -> str:
    return "--lsb-dps" if target.endswith("_dps") else "--lsb-g"


@dataclass(frozen=True)
class Edge:
    """Where a run starts or ends: a row of the table (the first is 0) or a time from its first sample, s."""

    value: float
    in_seconds: bool

    @staticmethod
    def parse(text: str, what: str) -> Edge | None:
        """``540`` is a row, ``5.2s`` a time, an empty text the table's own edge."""
        text = text.strip()
        if not text:
            return None
        match = re.fullmatch(r"(\d+)|([0-9.]+(?:[eE][-+]?\d+)?)\s*s", text)
        try:
            if match is None:
                raise ValueError
            return Edge(float(match[1] or match[2]), match[1] is None)
        except ValueError:
            raise InputError(f"{what}: {text!r} is neither a row number nor seconds such as 12.5s") from None


_META_NAMES = {"rate": "table_rate_dps", "turn": "turn_deg"}


def parse_meta(text: str, what: str) -> dict[str, Any]:
    """Read ``face=up,axis=x,rate=0,turn=360,scenario=s000,day=1,power_on_s=3`` into a run's keys of session.toml."""
    keys: dict[str, Any] = {}
    for part in filter(None, (p.strip() for p in text.split(","))):
        name, equals, value = (p.strip() for p in part.partition("="))
        name = _META_NAMES.get(name, name)
        if not equals or name not in RunEntry.model_fields or name == "file":
            known = ", ".join(k for k in RunEntry.model_fields if k != "file")
            raise InputError(f"{what}: {part!r} is not NAME=VALUE with a name of {known}, rate, turn")
        keys[name] = value
    return check_meta(keys, what)


def check_meta(keys: Mapping[str, Any], what: str) -> dict[str, Any]:
    """A run's keys with their types checked; those not given stay away."""
    from pydantic import ValidationError

    try:
        entry = RunEntry.model_validate({"file": "-", "face": "up", **keys})
    except ValidationError as error:
        fault = error.errors()[0]
        name = {v: k for k, v in _META_NAMES.items()}.get(str(fault["loc"][0]), fault["loc"][0])
        raise InputError(f"{what}: {name}={fault['input']}: {fault['msg']}") from None
    return {name: getattr(entry, name) for name in keys}


@dataclass(frozen=True)
class Cut:
    """One run to take out of a table; ``meta`` holds keys of session.toml's ``[[run]]``."""

    name: str
    start: Edge | None = None
    end: Edge | None = None
    meta: Mapping[str, Any] = field(default_factory=dict)

    @staticmethod
    def parse(text: str) -> Cut:
        """Read ``NAME:START:END[:face=up,axis=x,...]``; the end is the first row or moment not taken."""
        what = f"--run {text}"
        parts = text.split(":", 3)
        if len(parts) < 3:
            raise InputError(f"{what}: want NAME:START:END[:face=up,rate=0,...]")
        return Cut(
            check_name(parts[0].strip(), what),
            Edge.parse(parts[1], what),
            Edge.parse(parts[2], what),
            parse_meta(parts[3], what) if len(parts) == 4 else {},
        )


def check_name(name: str, what: str) -> str:
    """A run's name is its file's: letters, digits, ``_``, ``-`` and dots inside."""
    if not re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}", name):
        raise InputError(f"{what}: {name!r} cannot name a run; use letters, digits, _ and -")
    return name


def read_sections(path: Path) -> list[Cut]:
    """Cuts from JSON, ``{"name": {"start": row, "end": row}, ...}``; the end is the first row not taken."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: {_first_line(error)}") from None
    if not isinstance(content, dict) or not content:
        raise InputError(f'{path}: want {{"name": {{"start": row, "end": row}}, ...}}')
    cuts = []
    for name, section in content.items():
        rows = [section.get(k) for k in ("start", "end")] if isinstance(section, dict) else []
        if len(rows) != 2 or not all(type(r) is int and r >= 0 for r in rows):
            raise InputError(f"{path}: section {name!r} wants whole numbers start and end")
        start, end = (Edge(float(row), False) for row in rows if row is not None)
        cuts.append(Cut(check_name(name, str(path)), start, end))
    return cuts


def with_meta(cuts: Sequence[Cut], rules: Iterable[str], defaults: Mapping[str, Any]) -> list[Cut]:
    """Each cut with its keys: ``defaults``, then every rule ``PATTERN:key=value,...`` that fits, then its own."""
    parsed = []
    for rule in rules:
        what = f"--run-meta {rule}"
        pattern, colon, text = rule.partition(":")
        if not colon:
            raise InputError(f"{what}: want PATTERN:key=value,..., for example '*_rot:turn=360'")
        if not any(fnmatch.fnmatchcase(cut.name, pattern) for cut in cuts):
            raise InputError(f"{what}: no run is named so; there are {', '.join(c.name for c in cuts)}")
        parsed.append((pattern, parse_meta(text, what)))
    return [
        replace(cut, meta=_merge([defaults, *(k for p, k in parsed if fnmatch.fnmatchcase(cut.name, p)), cut.meta]))
        for cut in cuts
    ]


def _merge(layers: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """Later layers win; an angle takes the place of an earlier layer's rate, a rate that of an angle."""
    merged: dict[str, Any] = {}
    for layer in layers:
        for name, other in (("turn_deg", "table_rate_dps"), ("table_rate_dps", "turn_deg")):
            if name in layer and other not in layer:
                merged.pop(other, None)
        merged.update(layer)
    return merged


@dataclass(frozen=True)
class Source:
    """A table as it lies in a file: the wanted columns, not yet converted; ``first_row``: the file's row of entry 0.

    ``damage`` says in words what was left out of it.
    """

    label: str
    first_row: int
    frame: pl.DataFrame
    damage: str = ""

    def numbers(self, mapping: ColumnMap, start: int, end: int) -> Array:
        """A column's rows in the target's unit; NaN where an optional cell is empty. Time starts at 0."""
        column = self.frame[mapping.column][start:end]
        if mapping.target == "t_s" and not column.dtype.is_float():
            whole = column.cast(pl.Int64, strict=False)
            if whole.null_count() == 0:  # nanoseconds since 1970 do not fit a float64
                return (whole - whole[0]).to_numpy() * mapping.factor
        values = column.cast(pl.Float64, strict=False).to_numpy().astype(np.float64)
        bad = ~np.isfinite(values)
        if mapping.target in OPTIONAL:
            bad &= ~_missing(column)
        if bad.any():
            row = int(np.flatnonzero(bad)[0])
            shown = "empty" if column[row] in (None, "") else repr(column[row])
            where = f"{self.label}: row {self.first_row + start + row}"
            raise InputError(f"{where}: {mapping.column} is {shown}, not a finite number")
        if mapping.target == "t_s":
            values = values - values[0]
        return values * mapping.factor + mapping.offset


def _missing(column: pl.Series) -> np.ndarray[Any, np.dtype[np.bool_]]:
    if column.dtype == pl.String:
        return column.str.to_lowercase().is_in(["", "nan"]).fill_null(True).to_numpy()
    return column.cast(pl.Float64).is_nan().fill_null(True).to_numpy()


def read_source(
    path: Path,
    names: Sequence[str],
    optional: Sequence[str] = (),
    columns: Sequence[str] | None = None,
    skip: int | None = None,
) -> Source:
    """Read the columns ``names`` of a table, and those of ``optional`` that are there.

    ``columns`` names all columns where the file itself does not; ``skip`` lines stand above the header, by default as
    many as there are.
    """
    try:
        data = path.read_bytes()
        if data[:2] == b"\x1f\x8b":
            data = gzip.decompress(data)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: {getattr(error, 'strerror', None) or _first_line(error)}") from None
    if data[:4] == b"PAR1":
        return _read_parquet(path, data, names, optional)
    lines = data.decode("utf-8-sig", errors="replace").replace("\r\n", "\n").split("\n")
    while lines and not lines[-1].strip():
        lines.pop()
    if columns is None:
        header, separator = _find_header(path, lines, names, skip)
        columns, first = _cells(lines[header], separator), header + 1
    else:
        first, separator = _find_data(path, lines, columns, names, skip)
    names = _present(path, columns, names, optional)
    if first >= len(lines):
        raise InputError(f"{path}: row {first + 1}: no samples")
    wanted = [list(columns).index(name) for name in names]
    table: list[list[str]] = [[] for _ in names]
    damage = ""
    for number, line in enumerate(lines[first:], start=first + 1):
        cells = _split(line, separator)
        if number == len(lines) and len(cells) < len(columns) and number > first + 2:
            damage = f"row {number} was not written to its end ({len(cells)} cells of {len(columns)}) and is left out"
            break
        if len(cells) != len(columns):
            raise InputError(f"{path}: row {number}: {len(cells)} cells, there should be {len(columns)}")
        for taken, index in zip(table, wanted, strict=True):
            taken.append(cells[index])
    series = [pl.Series(n, cells, pl.String).str.strip_chars(QUOTES) for n, cells in zip(names, table, strict=True)]
    if separator == ";":
        series = [column.str.replace(",", ".", literal=True) for column in series]
    return Source(str(path), first + 1, pl.DataFrame(series), damage)


def _present(path: Path, columns: Sequence[str], names: Sequence[str], optional: Sequence[str]) -> list[str]:
    """The wanted names, each once; InputError where one is not there or not unique."""
    for name in names:
        if name not in columns:
            raise InputError(f"{path}: no column {name!r} among {', '.join(columns)[:200]}")
    wanted = list(dict.fromkeys([*names, *(n for n in optional if n in columns)]))
    for name in wanted:
        if list(columns).count(name) > 1:
            raise InputError(f"{path}: column {name!r} stands twice in the header")
    return wanted


def _read_parquet(path: Path, data: bytes, names: Sequence[str], optional: Sequence[str]) -> Source:
    try:
        frame = pl.read_parquet(io.BytesIO(data))
    except (OSError, pl.exceptions.PolarsError) as error:
        raise InputError(f"{path}: not a readable Parquet file: {_first_line(error)}") from None
    frame = frame.select(_present(path, frame.columns, names, optional))
    for name, dtype in frame.schema.items():
        if isinstance(dtype, pl.Datetime):
            frame = frame.with_columns(pl.col(name).dt.epoch("ns"))
        elif isinstance(dtype, pl.Duration):
            frame = frame.with_columns(pl.col(name).dt.total_nanoseconds())
        elif not (dtype.is_numeric() or dtype == pl.String):
            raise InputError(f"{path}: column {name!r} holds {dtype}, not numbers")
    if not frame.height:
        raise InputError(f"{path}: row 1: no samples")
    return Source(str(path), 1, frame)


def _split(line: str, separator: str) -> list[str]:
    return line.split() if separator == " " else line.split(separator)


def _cells(line: str, separator: str) -> list[str]:
    return [cell.strip(QUOTES + "#") for cell in _split(line, separator)]


def _find_header(path: Path, lines: list[str], names: Sequence[str], skip: int | None) -> tuple[int, str]:
    """The line that holds every wanted name, and the separator that shows them."""
    first, last = (0, HEADER_SEARCH_LINES) if skip is None else (skip, skip + 1)
    for number, line in list(enumerate(lines))[first:last]:
        for separator in ",\t; ":
            if set(names) <= set(_cells(line, separator)):
                return number, separator
    shown = lines[first : first + 1] or ["nothing"]
    where = "no line" if skip is None else f"row {skip + 1}"
    raise InputError(
        f"{path}: {where} names the columns {', '.join(dict.fromkeys(names))}; row {first + 1} is {shown[0][:120]!r} "
        "(other names: --map; no header: --columns a,b,c)"
    )


def _find_data(
    path: Path, lines: list[str], columns: Sequence[str], names: Sequence[str], skip: int | None
) -> tuple[int, str]:
    """The first line that has as many cells as there are names, numbers where numbers are wanted; and the separator."""
    wanted = [i for i, column in enumerate(columns) if column in names]
    first, last = (0, HEADER_SEARCH_LINES) if skip is None else (skip, skip + 1)
    for number, line in list(enumerate(lines))[first:last]:
        for separator in ",\t; ":
            cells = _cells(line, separator)
            if len(cells) == len(columns) and all(_is_number(cells[i]) for i in wanted):
                return number, separator
    shown = lines[first : first + 1] or ["nothing"]
    raise InputError(
        f"{path}: no row of {len(columns)} cells with numbers in {', '.join(dict.fromkeys(names))}; "
        f"row {first + 1} is {shown[0][:120]!r}"
    )


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", ".") or "0")
    except ValueError:
        return False
    return True


def cut_runs(
    source: Source, mappings: Sequence[ColumnMap], cuts: Sequence[Cut], rate_hz: float | None, axis: str
) -> list[Run]:
    """The cuts as runs, checked; without a mapping of ``t_s``, ``rate_hz`` numbers the samples."""
    height = source.frame.height
    by_target = {m.target: m for m in mappings}
    if "t_s" not in by_target and rate_hz is None:
        raise InputError(f"{source.label}: no time: map t_s, or give --rate-hz where samples are evenly spaced")
    runs = []
    for index, cut in enumerate(cuts):
        start = _row(source, by_target, cut.start, 0, rate_hz)
        end = _row(source, by_target, cut.end, height, rate_hz)
        if not 0 <= start < end <= height or end - start < 2:
            raise InputError(
                f"{source.label}: run {cut.name}: rows {start} to {end} of {height} do not hold two samples"
            )
        columns = {m.target: source.numbers(m, start, end) for m in mappings}
        if "t_s" not in columns:
            assert rate_hz is not None
            columns["t_s"] = np.arange(end - start) / rate_hz
        frame = pl.DataFrame({name: columns[name] for name in TARGETS if name in columns}).fill_nan(None)
        step = np.diff(np.rint(columns["t_s"] * 1e6))
        if (step <= 0).any():
            row = start + int(np.flatnonzero(step <= 0)[0]) + 1
            raise InputError(
                f"{source.label}: row {source.first_row + row}: time repeats or goes back; cut it with --run, "
                "or number the samples with --rate-hz and no t_s"
            )
        meta = cut.meta
        face = meta.get("face", "up")
        run = Run(
            index, f"{cut.name}.csv", meta.get("scenario", "s000"), face, meta.get("axis") or axis,  # type: ignore[arg-type]
            meta.get("table_rate_dps"), meta.get("turn_deg"), meta.get("day"), meta.get("power_on_s"),
            rate_hz or _nominal_rate_hz(columns["t_s"]), frame=check_table(frame, f"{source.label}: run {cut.name}"),
        )  # fmt: skip
        if run.table_rate_dps is None and run.turn_deg is None and "rate_ref_dps" not in columns:
            raise InputError(
                f"run {cut.name}: its true rate is not known; give --rate, --turn-deg, or map rate_ref_dps"
            )
        runs.append(run)
    return runs


def _row(
    source: Source, by_target: Mapping[str, ColumnMap], edge: Edge | None, default: int, rate_hz: float | None
) -> int:
    if edge is None:
        return default
    if not edge.in_seconds:
        return int(edge.value)
    if "t_s" in by_target:
        t_s = source.numbers(by_target["t_s"], 0, source.frame.height)
    else:
        assert rate_hz is not None
        t_s = np.arange(source.frame.height) / rate_hz
    return int(np.searchsorted(t_s, edge.value - 0.5e-6))


def _nominal_rate_hz(t_s: Array) -> float:
    return float(f"{1.0 / np.median(np.diff(t_s)):.5g}")


def import_recording(
    source: str | Path,
    out: str | Path,
    maps: Sequence[str] = (),
    *,
    cuts: Sequence[Cut] = (),
    run_meta: Sequence[str] = (),
    defaults: Mapping[str, Any] | None = None,
    axis: str = "z",
    scaling: Scaling | None = None,
    columns: Sequence[str] | None = None,
    skip: int | None = None,
    form: str | None = None,
    sensor: str | None = None,
    full_scale_dps: float | None = None,
    append: bool = False,
    warn: Callable[[Warning], None] = lambda _: None,
) -> Session:
    """Make a session of a recording; nothing is left behind where that fails.

    Args:
        source: the file; for EuRoC its folder (``imu0``) will do.
        out: the session's folder, new unless ``append``.
        maps: ``target=column[:unit][*factor]``; without any, the columns that bear a session's names.
        cuts: the runs to take; without any, the whole table is one.
        run_meta: ``PATTERN:key=value,...`` for the cuts whose names fit.
        defaults: keys of ``[[run]]`` for all of them.
        axis: the session's axis.
        form: a name of ``FORMATS``, whose mappings come before ``maps``.
        warn: told what was left out of the file.

    Raises:
        InputError: one line naming file, row or option, and the reason.
    """
    path, folder, scaling = Path(source), Path(out), scaling or Scaling()
    for name, size in vars(scaling).items():
        if size is not None and not (math.isfinite(size) and size > 0):
            raise InputError(f"--{name.replace('_', '-')}: {size} is not a positive number")
    if form is not None:
        if form not in FORMATS:
            raise InputError(f"--format {form}: there are {', '.join(FORMATS)}; other tables by --map")
        maps = [*FORMATS[form], *maps]
        path = next((p for p in (path / "data.csv", path / "imu0" / "data.csv") if p.is_file()), path)
    if folder.exists() and not append:
        raise InputError(f"{folder}: is there already; choose another name, or --append to add runs to it")
    mappings = list({m.target: m for m in (ColumnMap.parse(text, scaling) for text in maps)}.values())
    if mappings:
        lacking = [t for t in REQUIRED[1:] if t not in {m.target for m in mappings}]
        if lacking:
            raise InputError(f"{path}: nothing is mapped to {', '.join(lacking)}; see gyrocal import --help")
        table = read_source(path, [m.column for m in mappings], (), columns, skip)
    else:
        table = read_source(path, REQUIRED, OPTIONAL, columns, skip)
        mappings = [ColumnMap(name, name) for name in table.frame.columns]
    if table.damage:
        warn(Warning("line_damaged", None, None, f"{path}: {table.damage}"))
    existing = Session.open(folder, check=False) if append and folder.exists() else None
    number = len(existing.runs) if existing else 0
    face = (defaults or {}).get("face", "up")
    cuts = with_meta(list(cuts) or [Cut(f"{number:03d}_{face}")], run_meta, defaults or {})
    doubled = {c.name for c in cuts if [d.name for d in cuts].count(c.name) > 1}
    if doubled:
        raise InputError(f"--run: two runs are named {sorted(doubled)[0]!r}")
    runs = cut_runs(table, mappings, cuts, scaling.rate_hz, axis)
    if existing is not None:
        return _append(folder, existing, runs)
    session = Session(
        sample_rate_hz=scaling.rate_hz or runs[0].sample_rate_hz,
        runs=tuple(runs),
        axis=axis,  # type: ignore[arg-type]
        sensor=sensor,
        full_scale_dps=full_scale_dps,
        lsb_dps=scaling.lsb_dps,
    )
    return session.save(folder)


def _append(folder: Path, session: Session, runs: list[Run]) -> Session:
    """Add runs to a session: all of their files first, session.toml last."""
    header = read_header(folder).model_dump(exclude_none=True)
    entries = header.pop("run")
    for run in runs:
        if abs(run.sample_rate_hz / session.sample_rate_hz - 1.0) > 0.02:
            raise InputError(
                f"{folder}: is at {session.sample_rate_hz:g} Hz, run {run.file} at {run.sample_rate_hz:g} Hz; "
                "one session holds one rate"
            )
        if (folder / run.file).exists():
            raise InputError(f"{folder / run.file}: is there already; name the run otherwise with --run NAME::")
    written: list[Path] = []
    try:
        for run in runs:
            written.append(folder / run.file)
            write_table(run.table, folder / run.file)
        write_header(folder, header, [*entries, *(run_entry(run, run.file, session.axis) for run in runs)])
    except BaseException:
        for path in written:
            path.unlink(missing_ok=True)
        raise
    return Session.open(folder, check=False)


def _first_line(error: BaseException) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0]
