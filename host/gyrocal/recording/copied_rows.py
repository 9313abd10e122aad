"""Rows of a table that were written several times, time and all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import polars as pl

from gyrocal.recording.column_map import ColumnMap
from gyrocal.recording.session import Array
from gyrocal.recording.source import Booleans, Source
from gyrocal.recording.stamps import step_range_s

CHANCE = 1e-3
"""Probability below which it is no chance that readings repeat where times do, and hardly ever elsewhere."""
LONGER = 1.5
"""Part of the usual interval above which that after a row and its copy is two intervals."""
SELDOM = 0.01
"""Part of the other rows whose readings may be those of the row before."""


def copies(t_s: Array, equal_readings: Callable[[], Booleans]) -> Booleans | None:
    """The rows [n] that repeat the row before, time and all; None where there are none.

    ``equal_readings`` [n - 1] tells which rows have the readings of the row before. Samples that share the stamp of their
    arrival differ in their readings, unless the readings hardly ever change. If the next row comes after two intervals, the
    copy stands in the place of a sample of its own, and stays.
    """
    if t_s.size < 2 or step_range_s(t_s)[0] > 0:
        return None
    equal = equal_readings()
    stamped = np.diff(t_s) == 0
    twice = stamped & equal
    others = int((~stamped).sum())
    if not twice.any() or (equal & ~stamped).sum() > SELDOM * others:
        return None
    if (1 - twice.sum() / stamped.sum()) ** others > CHANCE:
        return None
    kept = np.concatenate([[True], ~twice])
    if kept.sum() < 2:
        return None
    steps_s, copied = np.diff(t_s[kept]), np.append(twice, False)[kept][:-1]
    if copied.any() and not copied.all() and np.median(steps_s[copied]) > LONGER * np.median(steps_s[~copied]):
        return None
    return ~kept


def written_once(source: Source, times: list[str]) -> Source:
    """The table without the rows that repeat the row before; ``times`` are the columns that may be its time."""
    for name in times:
        t_s = source.numbers(ColumnMap("t_s", name))
        if not np.isfinite(t_s).all():
            continue
        rows = copies(t_s, partial(_equal, source.frame.drop(name)))
        return source if rows is None else replace(source, frame=source.frame.filter(~rows))
    return source


def _equal(frame: pl.DataFrame) -> Booleans:
    """True for the rows [n - 1] of a table that are as the row before."""
    alike = [column.eq_missing(column.shift(1)).to_numpy()[1:] for column in frame]
    return np.all(alike, axis=0) if alike else np.zeros(frame.height, dtype=bool)
