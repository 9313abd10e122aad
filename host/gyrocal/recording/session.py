"""Session folders, ``gyrocal-session/1``: read, checked, written.

A session is a folder with ``session.toml`` and one table a run (CSV or Parquet). Bad input raises
:class:`~gyrocal.errors.InputError` with one line that names the file, the row (the header is row 1) and the reason.
"""

from __future__ import annotations

import datetime
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
import polars as pl
import tomli_w
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from gyrocal.errors import InputError, first_line
from gyrocal.files import new_folder, replace_text

FORMAT = "gyrocal-session/1"
AXES = ("x", "y", "z")
NUMBERS = b"0123456789+-.eE, \t\r\n" + b"nafiNAFI"
"""What a table's rows are made of; nan and inf are read, and then refused with their row."""
REQUIRED = ("t_s", "gx_dps", "gy_dps", "gz_dps")
OPTIONAL = ("ax_g", "ay_g", "az_g", "temp_c", "rate_ref_dps", "table_angle_deg")

UNITS = {"dps": "deg/s", "g": "g", "c": "degC", "deg": "degrees"}
"""The unit at the end of a column's name."""

LARGEST_DPS = 1e6

GAP_PERIODS = 1.5
"""Two samples that are further apart have lost one between them (GC_GAP_PERIODS in the core)."""

Array = np.ndarray[Any, np.dtype[np.float64]]
Axis = Literal["x", "y", "z"]
Face = Literal["up", "down"]


class RunEntry(BaseModel):
    """One ``[[run]]`` of session.toml."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)

    file: str
    scenario: str = "s000"
    face: Face
    axis: Axis | None = None
    table_rate_dps: float | None = None
    table_rate_se_dps: float | None = Field(default=None, ge=0)
    turn_deg: float | None = None
    day: int | None = None
    power_on_s: float | None = Field(default=None, ge=0)


class SessionFile(BaseModel):
    """session.toml."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)

    format: Literal["gyrocal-session/1"]
    sensor: str | None = None
    axis: Axis = "z"
    sample_rate_hz: float = Field(gt=0)
    full_scale_dps: float | None = Field(default=None, gt=0)
    lsb_dps: float | None = Field(default=None, gt=0)
    latitude_deg: float | None = Field(default=None, ge=-90, le=90)
    board: str | None = None
    rig: str | None = None
    line: str | None = None
    made_on: str | datetime.date | None = None
    accept: list[str] | None = None
    run: list[RunEntry] = Field(min_length=1)

    @model_validator(mode="after")
    def _files_differ(self) -> SessionFile:
        seen: set[str] = set()
        for entry in self.run:
            if entry.file in seen:
                raise ValueError(f"run file {entry.file!r} is listed twice")
            seen.add(entry.file)
        return self


@dataclass(frozen=True)
class Run:
    """One recording. Arrays are read from the file at first use and kept.

    Attributes have the names of session.toml's keys; ``rate_dps`` is the true rate about the sensed axis in the sensor's sign.
    """

    index: int
    file: str
    scenario: str
    face: Face
    axis: Axis
    table_rate_dps: float | None
    turn_deg: float | None
    day: int | None
    power_on_s: float | None
    sample_rate_hz: float
    path: Path | None = None
    frame: pl.DataFrame | None = field(default=None, repr=False, compare=False)
    lsb_dps: float | None = None
    latitude_deg: float | None = None
    unread: tuple[str, ...] = ()
    """Keys of the run's entry in session.toml that nobody reads."""
    table_rate_se_dps: float | None = None
    """Standard error of ``table_rate_dps``."""

    @property
    def axis_index(self) -> int:
        return AXES.index(self.axis)

    @property
    def face_sign(self) -> float:
        return 1.0 if self.face == "up" else -1.0

    @cached_property
    def _read(self) -> tuple[pl.DataFrame, str]:
        if self.frame is not None:
            return check_table(self.frame, self.file), ""
        assert self.path is not None
        return read_table_and_damage(self.path, self.file)

    @property
    def table(self) -> pl.DataFrame:
        """The run's table, checked."""
        return self._read[0]

    @property
    def damage(self) -> str:
        """What was left out of the table, in words; empty where nothing was."""
        return self._read[1]

    def __len__(self) -> int:
        return self.table.height

    @cached_property
    def t_s(self) -> Array:
        """Time in the run, shape [n], s, as in the file."""
        return self.table["t_s"].to_numpy()

    @cached_property
    def t_us(self) -> np.ndarray[Any, np.dtype[np.int64]]:
        """Whole microseconds since the first sample, shape [n]: what the device sees."""
        us = np.rint(self.t_s * 1e6).astype(np.int64)
        return us - us[0]

    @cached_property
    def gyro_dps(self) -> Array:
        """Measured rates, shape [n, 3], deg/s."""
        return self.table.select("gx_dps", "gy_dps", "gz_dps").to_numpy()

    @cached_property
    def step_dps(self) -> Array:
        """What the readings step by, shape [3], deg/s: the least by which successive ones differ; 0 where all are the same."""
        steps = np.abs(np.diff(self.gyro_dps, axis=0))
        least = np.min(steps, axis=0, where=steps > 0, initial=np.inf)
        return np.where(np.isfinite(least), least, 0.0)

    def column(self, name: str) -> Array | None:
        """An optional column, shape [n]; missing cells are NaN. None where the file lacks it or holds no value."""
        if name not in self.table.columns or self.table[name].null_count() == self.table.height:
            return None
        return self.table[name].to_numpy()

    @cached_property
    def acc_g(self) -> Array | None:
        """Acceleration, shape [n, 3], g; None unless all three columns are there."""
        parts = [self.column(name) for name in ("ax_g", "ay_g", "az_g")]
        return None if any(p is None for p in parts) else np.column_stack([p for p in parts if p is not None])

    @cached_property
    def temp_c(self) -> Array | None:
        """Temperature, shape [n], degC."""
        return self.column("temp_c")

    @cached_property
    def rate_dps(self) -> Array:
        """True rate about the run's axis in the sensor's sign, shape [n], deg/s.

        From ``rate_ref_dps`` where the file has it (cells that are missing lie on the line between those that are there: an
        encoder may be slower than the gyroscope), else the table's rate; for a run known by its angle alone, the mean
        rate ``turn_deg / duration`` (only its integral is meaningful; see :attr:`rate_is_mean`).
        """
        reference = self.column("rate_ref_dps")
        if reference is not None:
            known = np.isfinite(reference)
            return reference if known.all() else np.interp(self.t_s, self.t_s[known], reference[known])
        if self.table_rate_dps is not None:
            return np.full(len(self), self.table_rate_dps * self.face_sign)
        assert self.turn_deg is not None
        return np.full(len(self), self.turn_deg * self.face_sign / self.duration_s)

    @property
    def relative_rate_se(self) -> float:
        """Standard error of the stated table's rate, a fraction of it; 0 where none is given."""
        return abs(self.table_rate_se_dps / self.table_rate_dps) if self.table_rate_se_dps and self.table_rate_dps else 0.0

    @property
    def rate_is_mean(self) -> bool:
        """True where only the run's net angle is known, not its rate at each moment."""
        return self.table_rate_dps is None and self.turn_deg is not None and self.column("rate_ref_dps") is None

    @property
    def duration_s(self) -> float:
        """From the first sample to one period past the last, s."""
        return float(self.t_s[-1] - self.t_s[0]) * len(self) / (len(self) - 1)

    def first(self, seconds: float) -> Run | None:
        """The run's first ``seconds``; None if the run is shorter (ARCHITECTURE.md says how that is judged)."""
        limit_us = round(seconds * 1e6)
        inside = int(np.searchsorted(self.t_us, limit_us, side="left"))
        if inside == len(self) and self.t_us[-1] + 1.5e6 / self.sample_rate_hz < limit_us:
            return None
        return self.part(0, inside)

    def part(self, start: int, stop: int) -> Run:
        """Rows ``start:stop`` as a run of its own; a net angle is not known for a part, so ``turn_deg`` goes."""
        whole = start == 0 and stop == len(self)
        power_on_s = None if self.power_on_s is None else self.power_on_s + float(self.t_s[start] - self.t_s[0])
        return Run(
            self.index, self.file, self.scenario, self.face, self.axis, self.table_rate_dps,
            self.turn_deg if whole else None, self.day, power_on_s, self.sample_rate_hz,
            frame=self.table.slice(start, stop - start), lsb_dps=self.lsb_dps, latitude_deg=self.latitude_deg,
            table_rate_se_dps=self.table_rate_se_dps,
        )  # fmt: skip


@dataclass(frozen=True)
class Session:
    """A folder of runs; ``runs`` keep the file's order."""

    sample_rate_hz: float
    runs: tuple[Run, ...]
    axis: Axis = "z"
    sensor: str | None = None
    full_scale_dps: float | None = None
    lsb_dps: float | None = None
    latitude_deg: float | None = None
    path: Path | None = None
    accept: tuple[str, ...] = ()
    """Warnings that the user overrules, each a ``code`` or ``code:axis``."""
    unread: tuple[str, ...] = ()
    """Keys of session.toml that nobody reads."""

    @staticmethod
    def open(path: str | Path, *, check: bool = True) -> Session:
        """Read and check a session folder. With ``check=False`` the tables are read when first used."""
        folder = Path(path)
        header = read_header(folder)
        session = Session(
            sample_rate_hz=header.sample_rate_hz,
            runs=tuple(_run(i, entry, header, folder) for i, entry in enumerate(header.run)),
            axis=header.axis,
            sensor=header.sensor,
            full_scale_dps=header.full_scale_dps,
            lsb_dps=header.lsb_dps,
            latitude_deg=header.latitude_deg,
            path=folder,
            accept=tuple(header.accept or ()),
            unread=tuple(header.model_extra or ()),
        )
        for run in session.runs:
            if run.path is not None and not run.path.is_file():
                raise InputError(f"{folder / run.file}: no such file (named by {folder / 'session.toml'})")
            if check:
                _check_rate_known(run)
        return session

    def with_runs(self, runs: Iterable[Run]) -> Session:
        """The same session with other runs."""
        return replace(self, runs=tuple(runs))

    @property
    def rows(self) -> int:
        """Samples of all runs."""
        return sum(map(len, self.runs))

    @property
    def scenarios(self) -> list[str]:
        """Scenario names in order of first appearance."""
        return list(dict.fromkeys(run.scenario for run in self.runs))

    @property
    def days(self) -> list[int]:
        """Day labels in order of first appearance; runs without one are left out."""
        return list(dict.fromkeys(run.day for run in self.runs if run.day is not None))

    def by_scenario(self) -> Iterator[tuple[str, list[Run]]]:
        for name in self.scenarios:
            yield name, [run for run in self.runs if run.scenario == name]

    def save(self, path: str | Path, *, parquet: bool = False) -> Session:
        """Write the session into a new folder; InputError if it is there already."""
        folder = Path(path)
        if folder.exists():
            raise InputError(f"{folder}: is there already; choose another name or remove it")
        with new_folder(folder) as partial:
            entries = []
            for run in self.runs:
                name = str(Path(run.file).with_suffix(".parquet" if parquet else ".csv"))
                write_table(run.table, partial / name)
                entries.append(run_entry(run, name, self.axis))
            write_header(partial, self.header(), entries)
        return Session.open(folder, check=False)

    def header(self) -> dict[str, Any]:
        """session.toml's keys above the runs."""
        return {
            "format": FORMAT, "sensor": self.sensor, "axis": self.axis, "sample_rate_hz": self.sample_rate_hz,
            "full_scale_dps": self.full_scale_dps, "lsb_dps": self.lsb_dps, "latitude_deg": self.latitude_deg,
            "accept": list(self.accept) or None,
        }  # fmt: skip


def run_entry(run: Run, file: str, session_axis: str) -> dict[str, Any]:
    """One ``[[run]]`` for :func:`write_header`."""
    return {
        "file": file, "scenario": run.scenario, "face": run.face, "table_rate_dps": run.table_rate_dps,
        "table_rate_se_dps": run.table_rate_se_dps, "axis": None if run.axis == session_axis else run.axis,
        "turn_deg": run.turn_deg, "day": run.day, "power_on_s": run.power_on_s,
    }  # fmt: skip


def read_header(folder: Path) -> SessionFile:
    """Parse and check ``session.toml``."""
    path = folder / "session.toml"
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; a session is a folder with session.toml and a table a run") from None
    except NotADirectoryError:
        raise InputError(f"{folder}: not a folder; a session is a folder with session.toml and a table a run") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{path}: {error}") from None
    if raw.get("format") != FORMAT:
        raise InputError(f"{path}: format is {raw.get('format')!r}, this version reads {FORMAT!r}")
    try:
        return SessionFile.model_validate(raw, strict=True)  # a number in quotes is none
    except ValidationError as error:
        raise InputError(f"{path}: {describe(error)}") from None


def describe(error: ValidationError) -> str:
    """The first fault that pydantic found, in a person's words."""
    fault = error.errors()[0]
    where = ".".join(f"{part + 1}" if isinstance(part, int) else str(part) for part in fault["loc"])
    message = fault["msg"].removeprefix("Value error, ")
    return (
        f"{where}: {message} (got {fault['input']!r})" if where and fault["type"] != "missing" else f"{where} {message}".strip()
    )


def write_header(folder: Path, header: Mapping[str, Any], runs: Iterable[Mapping[str, Any]]) -> None:
    """Write ``session.toml`` whole or not at all; keys that are None are left out."""
    content: dict[str, Any] = {k: v for k, v in header.items() if v is not None}
    content["run"] = [{k: v for k, v in entry.items() if v is not None} for entry in runs]
    replace_text(folder / "session.toml", tomli_w.dumps(content), durable=False)


def write_table(table: pl.DataFrame, path: Path) -> None:
    """Write a run's table as Parquet or CSV, by the name's ending; times to the microsecond."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".parquet":
        table.write_parquet(path)
    else:
        table.with_columns(pl.col(c).round(6 if c == "t_s" else 9) for c in table.columns).write_csv(path)


def read_table(path: Path, name: str | None = None) -> pl.DataFrame:
    """Read and check a run's table (CSV or Parquet), float64 columns, missing optional cells null."""
    return read_table_and_damage(path, name)[0]


def read_table_and_damage(path: Path, name: str | None = None) -> tuple[pl.DataFrame, str]:
    """:func:`read_table`, and what was left out of it: a last row that was not written to its end."""
    label = str(path) if name is None or path.name == Path(name).name else name
    if path.suffix == ".parquet":
        try:
            return check_table(pl.read_parquet(path), label), ""
        except (OSError, pl.exceptions.PolarsError) as error:
            raise InputError(f"{label}: not a readable Parquet file: {first_line(error)}") from None
    try:
        content = path.read_bytes()
        first, _, body = content.partition(b"\n")
        header = [name.strip() for name in first.decode("utf-8-sig").strip().split(",")]
    except UnicodeDecodeError:
        raise InputError(f"{label}: row 1: not text in UTF-8; save the table as CSV in UTF-8") from None
    except OSError as error:
        raise InputError(f"{label}: {first_line(error)}") from None
    _check_columns(header, label)
    body, damage = _without_unfinished(body, len(header))
    if body.translate(None, NUMBERS):  # anything but numbers: name the row, before the fast reader meets it
        _find_bad_row(path, label, len(header))
    if not body.strip():
        raise InputError(f"{label}: row 2: no samples")
    try:
        table = pl.read_csv(body, has_header=False, new_columns=header, schema_overrides=[pl.Float64] * len(header))
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        _find_bad_row(path, label, len(header))
        raise InputError(f"{label}: {first_line(error)}") from None
    if table[header[-1]].null_count():
        _find_bad_row(path, label, len(header))
    return check_table(table, label), damage


def _without_unfinished(body: bytes, width: int) -> tuple[bytes, str]:
    """The rows of a table without a last one that was cut off, and what to say of it.

    A last row without a line's end may have lost digits: it is left out where its last cell is far from those above.
    """
    rows = body.rsplit(b"\n", 101)
    ended = rows[-1].strip() == b""
    if ended:
        rows.pop()
    if len(rows) < 3:
        return body, ""
    cells = rows[-1].split(b",")
    short = len(cells) < width and b"".join(cells).strip() != b""
    if not short and (ended or (_is_number_at(cells[-1]) and not _cut(cells[-1], rows[1:-1]))):
        return body, ""
    kept = body.rstrip()[: -len(rows[-1].rstrip())] if rows[-1].strip() else body
    what = f"{len(cells)} cells of {width}" if short else f"it ends with {cells[-1].decode(errors='replace')!r}"
    return kept, f"the last row was not written to its end ({what}) and is left out; nothing needs to be changed"


def _is_number_at(cell: bytes) -> bool:
    return _is_number(cell.decode(errors="replace"))


def _cut(cell: bytes, rows: list[bytes]) -> bool:
    """Is a last cell far from the last cells of the rows above: as a number that lost its end would be?"""
    above = [c for c in (row.rsplit(b",", 1)[-1].strip() for row in rows) if c and _is_number_at(c)]
    if not above:
        return False
    if not cell.strip():
        return len(above) == len(rows)
    values = [float(c) for c in above]
    low, high = min(values), max(values)
    return not low - (high - low) <= float(cell) <= high + (high - low)


def check_table(table: pl.DataFrame, label: str) -> pl.DataFrame:
    """The known columns of a table as float64, checked for finite values and time that runs forward."""
    _check_columns(table.columns, label)
    known = [c for c in (*REQUIRED, *OPTIONAL) if c in table.columns]
    try:
        table = table.select(pl.col(known).cast(pl.Float64))
    except pl.exceptions.PolarsError as error:
        raise InputError(f"{label}: {first_line(error)}") from None
    if table.height < 2:
        raise InputError(f"{label}: row {table.height + 1}: a run needs two samples at least")
    for name in known:
        column = table[name]
        bad = column.is_null() if name in REQUIRED else pl.repeat(False, table.height, eager=True)
        bad = bad | (column.is_finite() == False).fill_null(False)  # noqa: E712
        if bad.any():
            row = int(bad.arg_true()[0])
            value = column[row]
            raise InputError(f"{label}: row {row + 2}: {name} is {'empty' if value is None else value}, not a finite number")
    largest = max(float(table[name].abs().max()) for name in REQUIRED[1:])  # type: ignore[arg-type]
    if largest > LARGEST_DPS:
        raise InputError(f"{label}: a rate of {largest:.3g} deg/s is none a gyroscope reads; check the unit")
    t_s = table["t_s"].to_numpy()
    back = np.flatnonzero(np.diff(np.rint(t_s * 1e6)) <= 0)
    if back.size:
        row = int(back[0]) + 1
        word = "repeats" if t_s[row] == t_s[row - 1] else "goes back or moves by less than 1 us"
        raise InputError(f"{label}: row {row + 2}: t_s {word} ({t_s[row - 1]:.9g} then {t_s[row]:.9g})")
    return table.rechunk()


def _check_columns(columns: list[str], label: str) -> None:
    doubled = {c for c in columns if columns.count(c) > 1}
    if doubled:
        raise InputError(f"{label}: row 1: column {sorted(doubled)[0]!r} stands twice in the header")
    missing = [c for c in REQUIRED if c not in columns]
    if missing:
        raise InputError(f"{label}: row 1: the header lacks {', '.join(missing)}; it has {', '.join(columns)[:120]}")

    for name in OPTIONAL:
        stem, _, unit = name.rpartition("_")
        other = next((c for c in columns if c == stem or c.startswith(f"{stem}_")), None)
        if name not in columns and other is not None:
            raise InputError(
                f"{label}: row 1: {other} would not be read; what is read is {name}, in {UNITS[unit]}: convert it, or drop it"
            )


def _find_bad_row(path: Path, label: str, width: int) -> None:
    """Name the first row that is short, long or not a number; returns where there is none."""
    with path.open("r", encoding="utf-8", errors="replace") as handle:
        next(handle)
        for number, line in enumerate(handle, start=2):
            if not line.strip():
                raise InputError(f"{label}: row {number}: empty row")
            cells = line.rstrip("\r\n").split(",")
            if len(cells) != width:
                raise InputError(f"{label}: row {number}: {len(cells)} cells, the header has {width}")
            for cell in cells:
                if not _is_number(cell):
                    raise InputError(f"{label}: row {number}: {cell.strip()!r} is not a number")


def _is_number(cell: str) -> bool:
    """Empty counts; digits of other scripts and 1_000 do not, which Python would read."""
    try:
        return not cell.strip() or (cell.encode().translate(None, NUMBERS) == b"" and isinstance(float(cell), float))
    except ValueError:
        return False


def _run(index: int, entry: RunEntry, header: SessionFile, folder: Path) -> Run:
    return Run(
        index, entry.file, entry.scenario, entry.face, entry.axis or header.axis, entry.table_rate_dps, entry.turn_deg,
        entry.day, entry.power_on_s, header.sample_rate_hz, path=folder / entry.file,
        lsb_dps=header.lsb_dps, latitude_deg=header.latitude_deg, unread=tuple(entry.model_extra or ()),
        table_rate_se_dps=entry.table_rate_se_dps,
    )  # fmt: skip


def _check_rate_known(run: Run) -> None:
    where = run.path or run.file
    if run.column("rate_ref_dps") is None and run.table_rate_dps is None and run.turn_deg is None:
        raise InputError(f"{where}: no true rate: give table_rate_dps or turn_deg in session.toml, or a rate_ref_dps column")
