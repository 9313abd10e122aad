"""Tables whose rows are of several sensors in turn, as a column says."""

from __future__ import annotations

import re
from collections.abc import Collection

import polars as pl

from gyrocal.errors import InputError
from gyrocal.recording.column_names import bare_name
from gyrocal.recording.source import Source

OF_GYROSCOPES = r"(?i)g|gyr\w*|w|omega|angular\w*"
"""Words of a cell that says that a row is of a gyroscope."""
WHICH_SENSOR = r"(?:.*[/._ -])?(?:sensor|imu|device|node|board|mac|id)(?:[ _.-]?(?:id|type|name|no|number|address))?"
"""Words of a column that says which sensor a row is of."""
MOST_SENSORS = 16
ALTERNATE = 0.25
"""Part of the rows from which another sensor's follow each other in turn, and are no recordings one after the other."""


def named_as_sensor(name: str) -> bool:
    """True for a column whose name says that it tells which sensor a row is of."""
    return re.fullmatch(WHICH_SENSOR, bare_name(name)[0]) is not None


def of_gyroscopes(cells: pl.Series) -> bool:
    """True if one of the cells is a word for a gyroscope."""
    return cells.dtype == pl.String and any(re.fullmatch(OF_GYROSCOPES, str(cell)) for cell in cells.unique())


def check_one_sensor(source: Source, taken: Collection[str] = ()) -> None:
    """Raise InputError if a column says that the rows are of several sensors in turn, by its name or by words in its cells.

    ``taken`` are the columns that are mapped, which say nothing of that; rows without any cell of theirs do not count.
    """
    columns = [source.frame[name] for name in source.frame.columns if name not in taken]
    columns += [source.beside[name] for name in source.beside.columns if name not in source.frame.columns]
    empty = source.frame.select(pl.any_horizontal(pl.col(sorted(taken)).is_null())).to_series() if taken else None
    for column in columns:
        named = named_as_sensor(column.name)
        if not named and column.dtype != pl.String:
            continue
        cells = (column if empty is None else column.filter(~empty)).drop_nulls()
        kinds = cells.unique(maintain_order=True)
        if not named and not of_gyroscopes(kinds[: MOST_SENSORS + 1]):
            continue
        if 2 <= len(kinds) <= MOST_SENSORS and (cells != cells.shift()).sum() > ALTERNATE * len(cells):
            shown = ", ".join(f"{kind:g}" if isinstance(kind, float) else str(kind) for kind in kinds)
            raise InputError(
                f"{source.label}: {column.name} says that the rows are of several sensors ({shown}); keep those of one"
            )
