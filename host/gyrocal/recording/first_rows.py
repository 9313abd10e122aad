"""The first rows of a recording as they are read, by which a person sees that each column is what it is taken for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import isnan
from typing import Any

import polars as pl

from gyrocal.recording.column_map import ColumnMap
from gyrocal.recording.guess import Guess
from gyrocal.recording.source import Source

SHOWN_ROWS = 3


@dataclass(frozen=True)
class Taken:
    """A column with its first cells as they are in the file, what it is taken for, in which unit, and why.

    ``unit`` None: the target's own, or that of a factor.
    """

    file: str
    column: str
    values: tuple[str, ...]
    target: str
    unit: str | None
    why: str
    map: str
    """The mapping as an option states it."""

    def to_json(self) -> dict[str, Any]:
        """The fields by name."""
        return {**asdict(self), "values": list(self.values)}


def first_rows(source: Source, mappings: Sequence[ColumnMap], guessed: Sequence[Guess] = ()) -> tuple[Taken, ...]:
    """The columns that mappings take from a table, with their first cells."""
    why = {g.map.partition("=")[0]: g.why for g in guessed}
    names = list(dict.fromkeys(m.column for m in mappings))
    rows = source.frame.select(names).filter(~pl.all_horizontal(pl.all().is_null())).head(SHOWN_ROWS)
    return tuple(
        Taken(
            source.label, m.column, tuple(map(_shown, rows[m.column])), m.target, m.unit, why.get(m.target, "as stated"), m.text
        )
        for m in mappings
    )


def _shown(cell: Any) -> str:
    """A cell as it is in the file: of a number the fewest digits that are no other number."""
    missing = cell is None or (isinstance(cell, float) and isnan(cell))
    if missing or not isinstance(cell, float):
        return "" if missing else str(cell)
    short = f"{cell:.10g}"
    return short if float(short) == cell else repr(cell).removesuffix(".0")
