"""The table of somebody else's recording, as it lies in its file: columns by name, not yet converted."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from gyrocal.errors import InputError, did_you_mean
from gyrocal.recording.column_map import ColumnMap
from gyrocal.recording.session import Array
from gyrocal.recording.stamps import step_range_s
from gyrocal.recording.table import all_finite

Booleans = np.ndarray[Any, np.dtype[np.bool_]]
OTHER_WIDTH = "in a row of more or fewer cells"
"""Stands in each cell of such a row: nobody knows which cell belongs to which column."""
MOST_DAMAGED = 0.05
"""Largest fraction of damaged rows. If there are more, the columns or the units are wrong rather than a few rows."""
MISSING = ("", "nan", "null", "none", "nil", "na", "n/a", "#n/a", "-", "--", "?")
"""Words of a cell without a value, in lower case."""
WRAP = 2.0**32
"""A microcontroller's counter of micro- or milliseconds begins again here."""
AT_WRAP = 0.01
"""Part of the counter's range, before and after which a step back is one of these."""
DAY_NS = 86_400_000_000_000
MINUTE_NS = 60_000_000_000
CLOCK_12_H = ("%m/%d/%Y %I:%M:%S%.f %p", "%Y-%m-%d %I:%M:%S%.f %p")
"""Dates with AM and PM, month first."""
MINUTES = r"^(\d{1,5}):(\d\d(?:\.\d+)?)$"
"""Minutes and seconds, as spreadsheets show them."""
ZONE = r"(:\d\d(?:\.\d+)?) ?(?:Z|[A-Z]{3,5}|([+-]\d\d:?\d\d))$"
"""A time zone behind a time: UTC's letter, a name, or hours and minutes ahead of UTC."""
MARKED = r"^(\d{4})[-_/.](\d\d)[-_/.](\d\d)[-_ T](\d\d)[-_.](\d\d)[-_.](\d\d)"
"""A date and a time of day whose numbers stand between other marks than colons, as in names of files."""
LOOKED_AT = 20
"""Cells by which times written as text are recognized."""
SHOWN_COLUMNS = 40
"""Names of columns that an error lists."""
LIKELY = r"(?i)gyr|giro|omega|angular|rate|time|stamp|(?:^|[/._ ])[tw](?:$|[/._ ])"
"""Words of rates and times, whose columns are shown first among those that are not taken."""


@dataclass(frozen=True)
class Source:
    """A table: ``label`` names its file, ``first_row`` is the file's row of the table's entry 0.

    Cells of a text stay text until a column is converted. A row without any cell is a blank line.
    """

    label: str
    frame: pl.DataFrame
    first_row: int = 1
    si: bool = False
    """True if the kind of file defines its units, which are rad/s and m/s2."""
    names: tuple[str, ...] = ()
    """The names of all of the file's columns, where the table does not hold them all."""
    other_lengths: tuple[str, ...] = ()
    """Arrays of the file with another number of entries, which are no columns of the table, each with that number in words."""

    beside: pl.DataFrame = field(default_factory=pl.DataFrame)
    """Columns that were not asked for and may say which sensor a row is of."""
    above: tuple[str, ...] = ()
    """Lines of a text above its table and its header."""
    erased: int = 0
    """Rows behind the table that are of erased memory, and no part of it."""
    signed: Mapping[str, int] = field(default_factory=dict)
    """The columns whose counts had lost their sign, and the negative readings of each."""

    def check_has(self, names: Sequence[str]) -> None:
        """Raise InputError if one of the columns is missing."""
        for name in names:
            if name not in self.frame.columns:
                shown = ", ".join(self.frame.columns[:SHOWN_COLUMNS])
                near = did_you_mean(name, self.frame.columns)
                raise InputError(f"{self.label}: no column {name!r} among {shown}{near}{self.left_out}")

    @property
    def left_out(self) -> str:
        """What is in the file and in no column, in words that end an error."""
        others = ", ".join(self.other_lengths[:SHOWN_COLUMNS])
        return f"; of another length than these {self.frame.height} rows: {others}" if others else ""

    def not_taken(self, mappings: Sequence[ColumnMap]) -> str:
        """The columns that no mapping takes, in words that end an error."""
        taken = {m.column for m in mappings}
        left = [name for name in self.names or self.frame.columns if name not in taken]
        left.sort(key=lambda name: re.search(LIKELY, name) is None)
        return (f"; columns not taken: {', '.join(left[:SHOWN_COLUMNS])}" if left else "") + self.left_out

    def _column(self, mapping: ColumnMap) -> tuple[pl.Series, float]:
        """The column and the factor to the target's unit. Dates with times, and times of day, are whole nanoseconds."""
        column = self.frame[mapping.column]
        moments = moments_ns(column) if mapping.target == "t_s" else None
        return (column, mapping.factor) if moments is None else (moments, 1e-9)

    def row(self, entry: int) -> str:
        """The place of an entry in words."""
        return f"{self.label}: row {self.first_row + entry}"

    def numbers(self, mapping: ColumnMap) -> Array:
        """A column [n] in the target's unit; NaN for a cell without a finite number. Time counts from its first number."""
        column, factor = self._column(mapping)
        if mapping.target == "t_s" and not column.dtype.is_float():
            whole = column.cast(pl.Int64, strict=False)
            if whole.null_count() == _as_float(column).null_count() and whole.null_count() < len(whole):
                first = whole.drop_nulls()[0]  # nanoseconds since 1970 do not fit a float64
                return _unrolled(_finite((whole - first).cast(pl.Float64)), float(first)) * factor
        values = _finite(_as_float(column))
        if mapping.target == "t_s":
            values = _unrolled(values)
            first = values[0] if values.size and np.isfinite(values[0]) else next(iter(values[np.isfinite(values)]), 0.0)
            values = values - first if first else values
        if factor == 1.0 and mapping.offset == 0.0:
            return values
        return values * factor + mapping.offset

    def start_s(self, mapping: ColumnMap) -> float:
        """The moment of the column's first number in the clock of the file, s, that :meth:`numbers` counts time from."""
        column, factor = self._column(mapping)
        known = _as_float(column).drop_nulls()
        return float(known[0]) * factor if len(known) else 0.0

    def has_text(self, mapping: ColumnMap) -> Booleans:
        """The entries [n] whose cell is neither a number nor stands for a missing one."""
        column, _ = self._column(mapping)
        if column.dtype != pl.String or not (wrong := _as_float(column).is_null()).any():
            return np.zeros(len(column), dtype=bool)
        empty = column.str.to_lowercase().is_in([*MISSING, OTHER_WIDTH]).fill_null(True)
        return (wrong & ~empty).to_numpy()

    def blank(self) -> Booleans:
        """The entries [n] without any cell."""
        if not any(column.null_count() for column in self.frame):
            return np.zeros(self.frame.height, dtype=bool)
        return self.frame.select(pl.all_horizontal(pl.all().is_null())).to_series().to_numpy()


def _as_float(column: pl.Series) -> pl.Series:
    return column.cast(pl.Float64, strict=False)


def _finite(column: pl.Series) -> Array:
    values = column.to_numpy().astype(np.float64, copy=False)
    return values if all_finite(values) else np.where(np.isfinite(values), values, np.nan)


def _unrolled(counter: Array, first: float = 0.0) -> Array:
    """A counter [n] of 32 bits, less ``first``, that does not begin again; any other column as it is."""
    if step_range_s(counter)[0] > -WRAP * (1 - 2 * AT_WRAP):
        return counter
    before, after = counter[:-1] + first, counter[1:] + first
    again = (before > WRAP * (1 - AT_WRAP)) & (before < WRAP) & (after >= 0) & (after < WRAP * AT_WRAP)
    return counter + WRAP * np.concatenate([[0], np.cumsum(again)])


def of_arrays(
    path: Path, arrays: dict[str, Any], label: str | None = None, si: bool = False,
    holds: Callable[[Source], bool] = lambda _: True,
) -> Source:  # fmt: skip
    """A table of arrays by name, all of one length; [n, k] becomes the columns ``name.0`` to k - 1.

    [n, 3, 3] and [3, 3, n], matrices, become ``name.0`` to 8, in the order of a matrix's rows.

    Of several lengths it is the one that holds most numbers and what ``holds`` asks for, or most numbers if none does.
    Parameters of three numbers may be more than the columns of the readings.

    InputError where no array of numbers has two entries.
    """
    columns: dict[str, Any] = {}
    for name, value in arrays.items():
        array = np.asarray(value)
        if array.dtype.kind not in "fiub" or array.size < 2:
            continue
        array = _rows_of_matrices(array.squeeze())
        if array.ndim == 1:
            columns[name] = array
        elif array.ndim == 2:
            across = array if array.shape[0] >= array.shape[1] else array.T
            columns.update({f"{name}.{i}": across[:, i] for i in range(across.shape[1])})
    lengths = [array.size for array in columns.values()]
    if not lengths:
        raise InputError(f"{path}: no columns of numbers in it")

    def table(length: int) -> Source:
        frame = pl.DataFrame({name: np.ascontiguousarray(a) for name, a in columns.items() if a.size == length})
        others = tuple(f"{name} ({a.size})" for name, a in columns.items() if a.size != length)
        return Source(label or str(path), frame, si=si, other_lengths=others)

    tables = [table(n) for n in sorted(set(lengths), key=lambda n: (n * lengths.count(n), n), reverse=True)]
    return next(filter(holds, tables), tables[0])


def _rows_of_matrices(array: Any) -> Any:
    """Matrices [n, 3, 3] or [3, 3, n] as [n, 9], in the order of their rows; any other array as it is."""
    if array.ndim != 3:
        return array
    matrices = np.moveaxis(array, -1, 0) if array.shape[:2] == (3, 3) and array.shape[2] != 3 else array
    return matrices.reshape(-1, 9) if matrices.shape[1:] == (3, 3) else array


def moments_ns(column: pl.Series) -> pl.Series | None:
    """Dates with times, or times of day, as whole nanoseconds [n]; None if the column is none of these.

    An offset from UTC is subtracted, because it changes when summer time ends. A zone that is named counts as UTC: only
    differences of time matter.
    """
    if column.dtype != pl.String:
        return column.cast(pl.Datetime("ns")).cast(pl.Int64) if column.dtype == pl.Datetime else None
    zoned = column.str.strip_chars().str.replace(MARKED, "$1-$2-$3 $4:$5:$6")
    text = zoned.str.replace(ZONE, "$1")
    parts = [text.str.extract(MINUTES, group).cast(pl.Float64) for group in (1, 2)]
    if parts[1].null_count() < len(text):
        return ((60 * parts[0] + parts[1]) * 1e9).round().cast(pl.Int64)
    if not text.drop_nulls().head(LOOKED_AT).str.contains(r"\d:\d\d:\d\d").any():
        return None
    return _moments_of_text_ns(text) - _ahead_of_utc_ns(zoned)


def _moments_of_text_ns(text: pl.Series) -> pl.Series:
    for form in CLOCK_12_H:
        moments = text.str.to_datetime(form, time_unit="ns", strict=False)
        if moments.null_count() < len(moments):
            return moments.cast(pl.Int64)
    try:
        return text.str.to_datetime(time_unit="ns", strict=False).cast(pl.Int64)
    except pl.exceptions.ComputeError:
        of_day = text.str.to_time("%H:%M:%S%.f", strict=False).cast(pl.Int64)
        return of_day + DAY_NS * (of_day.diff() < -DAY_NS // 2).fill_null(False).cum_sum().cast(pl.Int64)


def _ahead_of_utc_ns(zoned: pl.Series) -> pl.Series:
    """How far the clock of each text is ahead of UTC, ns; 0 where it states no offset."""
    offset = zoned.str.extract(ZONE, 2).str.replace(":", "", literal=True)
    minutes = 60 * offset.str.slice(1, 2).cast(pl.Int64) + offset.str.slice(3, 2).cast(pl.Int64)
    sign = 1 - 2 * offset.str.starts_with("-").cast(pl.Int64)
    return (sign * minutes * MINUTE_NS).fill_null(0)
