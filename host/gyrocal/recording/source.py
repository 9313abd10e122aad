"""Others' tables as they lie in files.

A table is CSV (comma, semicolon, tab or space; lines of other text may stand above it; gzip or not) or Parquet.
"""

from __future__ import annotations

import gzip
import io
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from gyrocal.errors import InputError, first_line
from gyrocal.recording.column_map import ColumnMap
from gyrocal.recording.session import Array
from gyrocal.recording.table import OPTIONAL

HEADER_SEARCH_LINES = 200
QUOTES = " \t\"'"


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
        raise InputError(f"{path}: {getattr(error, 'strerror', None) or first_line(error)}") from None
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
        raise InputError(f"{path}: not a readable Parquet file: {first_line(error)}") from None
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
