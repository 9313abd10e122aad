"""Times in two columns, whole seconds and the rest in nano- or microseconds, as ROS stamps messages, in one column."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import polars as pl

from gyrocal.recording.column_map import ColumnMap
from gyrocal.recording.column_names import bare_name
from gyrocal.recording.source import Source

SECONDS = r"(?P<before>(?:.*[/._])?)(?:s|secs?|seconds?)(?P<behind>(?:[/._].*)?)"
RESTS = ((r"(?:ns|nsecs?|nanos|nano_?sec(?:ond)?s?)", 1), (r"(?:us|usecs?|micros|micro_?sec(?:ond)?s?)", 1000))
"""Words of the rest's column, and its unit, ns."""
SECOND_NS = 1_000_000_000
MOSTLY = 0.5
"""Part of the rows that must hold a stamp: a slower sensor of the same table has stamps of its own."""


def is_whole_stamp(name: str) -> bool:
    """True for the name of a column that :func:`with_whole_stamps` adds."""
    return name.endswith(".stamp_ns")


def with_whole_stamps(source: Source) -> Source:
    """The table with a column ``.stamp_ns``, whole nanoseconds, for each two columns that hold a time together."""
    bare = {bare_name(name)[0]: name for name in reversed(source.frame.columns)}
    added: dict[str, pl.Series] = {}
    for word, name in bare.items():
        if (match := re.fullmatch(SECONDS, word)) is None:
            continue
        for words, unit_ns in RESTS:
            before, behind = match["before"], match["behind"]
            rest = next((n for w, n in bare.items() if re.fullmatch(re.escape(before) + words + re.escape(behind), w)), None)
            if rest is not None and (stamps := _stamps(source, name, rest, unit_ns)) is not None:
                added.setdefault(f"{re.sub('[/._]+', '_', before + behind).strip('_') or 'clock'}.stamp_ns", stamps)
    return replace(source, frame=source.frame.with_columns(**added)) if added else source


def _stamps(source: Source, seconds: str, rest: str, unit_ns: int) -> pl.Series | None:
    """Nanoseconds [n]; None where the columns are not whole seconds and a rest of less than one."""
    start_s = source.start_s(ColumnMap("t_s", seconds))
    whole_s = source.numbers(ColumnMap("t_s", seconds)) + start_s
    rest_ns = source.numbers(ColumnMap("gz_dps", rest)) * unit_ns
    known = np.isfinite(whole_s) & np.isfinite(rest_ns)
    if known.mean() < MOSTLY or np.any(whole_s[known] % 1) or rest_ns[known].min() < 0 or rest_ns[known].max() >= SECOND_NS:
        return None
    stamps = np.zeros(known.size, dtype=np.int64)
    stamps[known] = np.rint(whole_s[known]).astype(np.int64) * SECOND_NS + np.rint(rest_ns[known]).astype(np.int64)
    return pl.Series(stamps).set(pl.Series(~known), None)
