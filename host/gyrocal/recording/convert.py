"""A table's columns in a session's units: rows that hold no sample left out and counted, times that repeat replaced."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
import polars as pl

from gyrocal.errors import InputError
from gyrocal.recording.column_map import ColumnMap
from gyrocal.recording.copied_rows import copies
from gyrocal.recording.measured_rates import QUATERNION
from gyrocal.recording.orientation import ALIKE_WITHIN, UNIT_WITHIN
from gyrocal.recording.padding import readings_within
from gyrocal.recording.session import Array
from gyrocal.recording.source import MOST_DAMAGED, OTHER_WIDTH, Booleans, Source
from gyrocal.recording.stamps import damaged_stamps, step_range_s
from gyrocal.recording.table import REQUIRED, all_finite
from gyrocal.recording.timing import smoothing_spline

Index = np.ndarray[Any, np.dtype[np.intp]]
Kind = TypeVar("Kind", bound=np.dtype[Any])
ACCELERATIONS = ("ax_g", "ay_g", "az_g")
ANGLE_SMOOTHING = 16.0
"""Bandwidth of the spline that differentiates an angle, in steps of it (its penalty is this times the step cubed)."""


@dataclass(frozen=True)
class Converted:
    """Columns [n] by target in a session's units; ``gaps`` are the rows without a sample before the last one, from 0."""

    columns: Mapping[str, Array]
    gaps: Index = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    headers: Index = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    """Rows that repeat the header."""
    damage: str = ""
    left_out: int = 0
    """Rows without a sample: damaged ones, lines of text, zeros at either end, and erased memory behind the last reading."""
    cells: int = 0
    """Text in optional columns, taken as missing."""
    repeated: int = 0
    """Rows that were written twice, of which one is kept."""
    stamps: int = 0
    """Damaged times, put onto the course of the others."""
    orientations: int = 0
    """Damaged quaternions, taken as missing."""

    @property
    def size(self) -> int:
        """Samples of the table."""
        return next(iter(self.columns.values())).size

    @property
    def height(self) -> int:
        """Rows of the table up to its last sample."""
        return self.size + self.gaps.size

    def place(self, row: int) -> int:
        """The number of the first sample in a row of the table, or in one after it."""
        return row - int(np.searchsorted(self.gaps, row))

    def row(self, place: int) -> int:
        """The row of the table that holds a sample."""
        return int(np.delete(np.arange(self.height), self.gaps)[place])


def convert(source: Source, mappings: Sequence[ColumnMap], rate_hz: float | None) -> Converted:
    """The mapped columns. Without a time, ``rate_hz`` numbers the samples; a damaged row leaves a gap.

    InputError where more than a few rows hold no number in a column that every sample has.
    """
    values = {m.target: source.numbers(m) for m in mappings}
    if _is_whole(source, mappings, values):
        return _mended(source, mappings, Converted(values), rate_hz)
    kept = _where_not(source.blank())
    values = {name: _rows(column, kept) for name, column in values.items()}
    text = {m.target: _rows(source.has_text(m), kept) for m in mappings}
    lacking = {m.target: _missing(values[m.target]) for m in mappings if m.target in REQUIRED}
    bad = np.any([rows for rows in lacking.values() if rows.any()] or [np.zeros(kept.size, dtype=bool)], axis=0)
    footer = bad if not bad.any() else _footer(bad, list(lacking.values()), list(text.values()))
    damaged = bad & ~footer
    _check_few(source, mappings, kept, damaged, lacking)
    cells = 0
    for m in mappings:
        if m.target not in REQUIRED:
            wrong = text[m.target] & ~bad
            _check_few(source, [m], kept, wrong, {m.target: wrong})
            cells += int(wrong.sum())
    good = _where_not(bad)
    columns = {name: _rows(column, good) for name, column in values.items()}
    damage = _words(source, mappings, kept, damaged, footer, lacking)
    gaps = np.flatnonzero(bad & ~_after_last(~bad))
    headers = _headers(source, mappings, kept, gaps)
    return _mended(source, mappings, Converted(columns, gaps, headers, damage, int(bad.sum()), cells), rate_hz)


def _headers(source: Source, mappings: Sequence[ColumnMap], kept: Index, rows: Index) -> Index:
    """Those of the rows [n] whose cells are the names of their columns."""
    cells = [(m.column, source.frame[m.column].gather(kept[rows])) for m in mappings]
    named = [(column == name).fill_null(False).to_numpy() for name, column in cells if column.dtype == pl.String]
    return rows[np.all(named, axis=0)] if named and rows.size else rows[:0]


def _mended(source: Source, mappings: Sequence[ColumnMap], table: Converted, rate_hz: float | None) -> Converted:
    read = _with_course(source, _without_padding(source, mappings, table))
    return _with_rotations(source, _finished(_told_erased(source, read), rate_hz))


def _told_erased(source: Source, table: Converted) -> Converted:
    """The table, with the rows of erased memory counted that were behind it."""
    if not source.erased:
        return table
    told = (
        f"{source.erased} rows of erased memory are left out, which repeat one row at the file's end, time and all (from row "
        f"{source.first_row + source.frame.height} on)"
    )
    return replace(table, damage=", and ".join(filter(None, (table.damage, told))), left_out=table.left_out + source.erased)


def _without_padding(source: Source, mappings: Sequence[ColumnMap], table: Converted) -> Converted:
    """The table without the rows of zeros before its first reading and after its last one."""
    zeros = {m.target: m.offset for m in mappings}
    gyro, acc = (
        [table.columns[name] - zeros[name] if zeros[name] else table.columns[name] for name in names if name in zeros]
        for names in (REQUIRED[1:], ACCELERATIONS)
    )
    first, end = readings_within(gyro, acc)
    padding = [*range(first), *range(end, table.size)] if gyro else []
    if not padding:
        return table
    rows = np.delete(np.arange(table.height), table.gaps)
    many = f"{len(padding)} rows of zeros are" if len(padding) > 1 else "a row of zeros is"
    told = f"{many} left out, which no sensor reads (from row {source.first_row + int(rows[padding[0]])} on)"
    gaps = np.setdiff1d(np.arange(rows[end - 1] + 1), rows[first:end])
    columns = {name: column[first:end] for name, column in table.columns.items()}
    damage = ", and ".join(filter(None, (table.damage, told)))
    return replace(table, columns=columns, gaps=gaps, damage=damage, left_out=table.left_out + len(padding))


def _is_whole(source: Source, mappings: Sequence[ColumnMap], values: Mapping[str, Array]) -> bool:
    """True if every row of the table is a sample and no cell a text, which is seen without an array of rows."""
    numbers = all(source.frame[m.column].dtype.is_numeric() for m in mappings)
    return numbers and all(all_finite(values[name]) for name in REQUIRED if name in values)


def _finished(table: Converted, rate_hz: float | None) -> Converted:
    """The table with times, if it has none, and with an angle that is not folded into a turn."""
    table = _written_once(table)
    columns = dict(table.columns)
    if "t_s" not in columns and rate_hz is not None:
        columns["t_s"] = np.delete(np.arange(table.height), table.gaps) / rate_hz
    if "ref_angle_deg" in columns:
        columns["ref_angle_deg"] = unwrapped(columns["ref_angle_deg"])
    return replace(table, columns=columns)


def _with_course(source: Source, table: Converted) -> Converted:
    """The table with the few damaged stamps put onto the course of the others."""
    t_s = table.columns.get("t_s")
    if t_s is None or t_s.size < 3 or step_range_s(t_s)[0] >= 0:
        return table
    off = damaged_stamps(t_s)
    if not 0 < off.size <= MOST_DAMAGED * t_s.size:
        return table
    right = np.delete(np.arange(t_s.size), off)
    course_s = np.interp(np.arange(t_s.size), right, t_s[right])
    many = f"{off.size} damaged times are" if off.size > 1 else "a damaged time is"
    first = int(off[0])
    told = (
        f"{many} put onto the course of the others (row {source.first_row + table.row(first)}: the time is "
        f"{t_s[first] - course_s[first]:+.4g} s off)"
    )
    damage = ", and ".join(filter(None, (table.damage, told)))
    return replace(table, columns={**table.columns, "t_s": course_s}, damage=damage, stamps=int(off.size))


def _of_length_one(table: Converted, size: Array) -> Converted:
    """The table with quaternions of the lengths [n] divided by these, where nearly all of them are of about one length."""
    length = float(np.median(size[size > 0]))
    alike = np.abs(size - length) <= ALIKE_WITHIN * length
    if (size > 0).sum() - alike.sum() > MOST_DAMAGED * size.size:
        return table
    unit = np.where(alike, size, np.nan)
    columns = {name: np.where(size == 0, 0.0, table.columns[name] / unit) for name in QUATERNION}
    from_to = f"{size[alike].min():.4g} to {size[alike].max():.4g}"
    told = f"the quaternions are of the length {length:.4g}, not 1 ({from_to}), and are divided by it"
    damage = ", and ".join(filter(None, (table.damage, told)))
    return replace(table, columns={**table.columns, **columns}, damage=damage)


def _with_rotations(source: Source, table: Converted) -> Converted:
    """The table without the few orientations whose quaternion has not the length 1; a row of zeros is missing anyway.

    Quaternions of about one other length are divided by it.
    """
    if not set(QUATERNION) <= set(table.columns):
        return table
    size = np.sqrt(sum(table.columns[name] ** 2 for name in QUATERNION))
    wrong = (np.abs(size - 1) > UNIT_WITHIN) & (size > 0)
    if wrong.sum() > MOST_DAMAGED * wrong.size:
        return _of_length_one(table, size)
    if not wrong.any():
        return table
    first, count = int(np.flatnonzero(wrong)[0]), int(wrong.sum())
    many = f"{count} damaged orientations are" if count > 1 else "a damaged orientation is"
    row = source.first_row + table.row(first)
    told = f"{many} left out (row {row}: the quaternion has the length {size[first]:.4g}, not 1)"
    columns = {name: np.where(wrong, np.nan, table.columns[name]) for name in QUATERNION}
    damage = ", and ".join(filter(None, (table.damage, told)))
    return replace(table, columns={**table.columns, **columns}, damage=damage, orientations=count)


def _written_once(table: Converted) -> Converted:
    """The table without rows that repeat the row before, time and all."""
    t_s = table.columns.get("t_s")
    if t_s is None:
        return table
    readings = [c for name, c in table.columns.items() if name != "t_s"]
    twice = copies(t_s, lambda: np.all([(c[1:] == c[:-1]) | (np.isnan(c[1:]) & np.isnan(c[:-1])) for c in readings], axis=0))
    if twice is None:
        return table
    rows = np.delete(np.arange(table.height), table.gaps)
    columns = {name: column[~twice] for name, column in table.columns.items()}
    gaps = np.sort(np.concatenate([table.gaps, rows[twice]]))
    return replace(table, columns=columns, gaps=gaps, repeated=int(twice.sum()))


def _missing(column: Array) -> Booleans:
    return np.zeros(column.size, dtype=bool) if all_finite(column) else np.isnan(column)


def _rows(column: np.ndarray[Any, Kind], rows: Index) -> np.ndarray[Any, Kind]:
    """These rows, in order, of a column; the column itself where they are all."""
    return column if rows.size == column.size else column[rows]


def _where_not(rows: Booleans) -> Index:
    """The places of the rows [n] that are not marked."""
    return np.flatnonzero(~rows) if rows.any() else np.arange(rows.size)


def _footer(bad: Booleans, lacking: Sequence[Booleans], text: Sequence[Booleans]) -> Booleans:
    """The rows that hold no number at all but text, or stand after the last sample."""
    return np.all(lacking, axis=0) & (np.any(text, axis=0) | _after_last(~bad))


def _after_last(good: Booleans) -> Booleans:
    """The entries after the last good one."""
    last = int(np.flatnonzero(good)[-1]) if good.any() else -1
    return np.arange(good.size) > last


def _first(source: Source, mappings: Sequence[ColumnMap], kept: Index, rows: Booleans, lacking: Mapping[str, Booleans]) -> str:
    """The first of these rows and what is wrong in it, in words."""
    row = int(np.flatnonzero(rows)[0])
    column = next(m.column for m in mappings if m.target in lacking and lacking[m.target][row])
    cell = source.frame[column][int(kept[row])]
    shown = "empty" if cell in (None, "") else repr(cell)
    return f"row {source.first_row + int(kept[row])}: {column} is {shown}, not a finite number"


def _check_few(
    source: Source, mappings: Sequence[ColumnMap], kept: Index, rows: Booleans, lacking: Mapping[str, Booleans]
) -> None:
    count = int(rows.sum())
    if count > MOST_DAMAGED * rows.size:
        more = f"; {count} of {rows.size} rows are so. Take another column, or delete these rows" if count > 1 else ""
        raise InputError(f"{source.label}: {_first(source, mappings, kept, rows, lacking)}{more}")


def _words(
    source: Source, mappings: Sequence[ColumnMap], kept: Index, damaged: Booleans, footer: Booleans,
    lacking: Mapping[str, Booleans],
) -> str:  # fmt: skip
    """The rows that were left out, in words; empty if there are none."""
    told = []
    if damaged.any():
        many = f"{int(damaged.sum())} damaged rows are" if damaged.sum() > 1 else "a damaged row is"
        told.append(f"{many} left out ({_first(source, mappings, kept, damaged, lacking)})")
    if footer.any() and source.frame[mappings[0].column][int(kept[np.flatnonzero(footer)[-1]])] == OTHER_WIDTH:
        footer = footer.copy()
        cut = int(np.flatnonzero(footer)[-1])
        footer[cut] = False
        told.append(f"the last row, which is unfinished, is left out (row {source.first_row + int(kept[cut])})")
    if footer.any():
        many = f"{int(footer.sum())} lines of text are" if footer.sum() > 1 else "a line of text is"
        told.append(f"{many} left out (row {source.first_row + int(kept[np.flatnonzero(footer)[0]])})")
    return ", and ".join(told)


def rate_of(t_s: Array, angle_deg: Array) -> Array:
    """The derivative of an angle [n], deg, by a smoothing spline, deg/s; NaN outside the angles that are known.

    ``t_s`` [n], s, increases; the angle may be folded into a turn.
    """
    from scipy.interpolate import CubicSpline

    known = np.flatnonzero(np.isfinite(angle_deg))
    rate_dps = np.full(t_s.size, np.nan)
    if known.size < 5:
        return rate_dps
    x, y = t_s[known], unwrapped(angle_deg[known])
    step_s = float(x[-1] - x[0]) / (x.size - 1)
    inside = slice(known[0], known[-1] + 1)
    rate_dps[inside] = CubicSpline(x, smoothing_spline(x, y, ANGLE_SMOOTHING * step_s**3))(t_s[inside], 1)
    return rate_dps


def unwrapped(angle_deg: Array) -> Array:
    """An angle [n], deg, that is not folded into a turn."""
    known = np.isfinite(angle_deg)
    out = angle_deg.copy()
    out[known] = np.unwrap(angle_deg[known], period=360.0)
    return out
