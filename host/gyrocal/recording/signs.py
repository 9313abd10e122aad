"""Counts of 16 bits that lost their sign: a program read the words of a gyroscope or an accelerometer as unsigned ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import polars as pl

from gyrocal.errors import InputError
from gyrocal.recording.column_map import ColumnMap
from gyrocal.recording.session import Array
from gyrocal.recording.source import Source

CODES, NEGATIVE = 65536, 32768
"""Codes of 16 bits. Those from the second on are negative ones in two's complement, and positive ones about a zero there."""
MIDDLE = 4096
"""Codes beside the middle and the ends of the range: there are the largest rates if counts have a sign, here the smallest."""
SELDOM = 0.1
"""Readings beside the middle of the range over those beside its ends, and steps across both, of counts without their sign: 0.01
in 137 s of turns by hand, whose fastest went beyond the range on each axis."""
FEWEST_STEPS = 8
"""Steps across the ends of the range, from one reading to the next: readings pass through zero."""
WORDS = 0.95
"""Part of the cells that are words of hexadecimal digits if a column holds these."""


def with_signs(source: Source, names: Sequence[str]) -> Source:
    """The table with the signs of its counts, if it is sure that they lost them; ``names`` are columns of readings.

    Counts about zero are at both ends of the range, seldom in its middle, and step from one end to the other. The columns of
    all sensors are of one program and decide together, because one that shows gravity need not pass through zero.
    """
    columns = {name: values for name in names if (values := _of_16_bits(source, name)) is not None}
    wide = {name: values for name, values in columns.items() if np.any(values >= NEGATIVE)}
    ends = sum(int(np.sum(np.abs(np.diff(values)) > NEGATIVE)) for values in wide.values())
    across = sum(int(np.sum(np.abs(np.diff(_signed(values))) > NEGATIVE)) for values in wide.values())
    if ends < FEWEST_STEPS or across > SELDOM * ends:
        return source
    beside = sum(int(np.sum(np.abs(_signed(values)) < MIDDLE)) for values in wide.values())
    middle = sum(int(np.sum(np.abs(values - NEGATIVE) < MIDDLE)) for values in wide.values())
    if middle > SELDOM * beside:
        return source
    counted = {name: int(np.sum(values >= NEGATIVE)) for name, values in wide.items()}
    return replace(source, frame=source.frame.with_columns(_decoded(source.frame[name]) for name in wide), signed=counted)


def check_decimal(source: Source, names: Sequence[str]) -> None:
    """InputError if a column of readings holds words of 4 or 8 hexadecimal digits, some of which look like decimal numbers."""
    for name in names:
        cells = source.frame[name].drop_nulls()
        if cells.dtype != pl.String or not len(cells) or not cells.str.contains(r"[A-Fa-f]").any():
            continue
        words = cells.filter(cells.str.contains(r"^(?:[0-9A-Fa-f]{4}|[0-9A-Fa-f]{8})$"))
        letters = words.filter(words.str.contains(r"[A-Fa-f]") & words.cast(pl.Float64, strict=False).is_null())
        if len(letters) < 2 or len(words) < WORDS * len(cells):
            continue
        half = 2 ** (4 * len(letters[0]) - 1)
        raise InputError(
            f"{source.label}: {name} holds hexadecimal numbers, as {letters[0]}; write decimal ones (int(CELL, 16)), less "
            f"{2 * half} where they are {half} or more"
        )


def _of_16_bits(source: Source, name: str) -> Array | None:
    """The numbers of a column, if they are whole ones of 16 bits without a sign."""
    values = source.numbers(ColumnMap("gz_dps", name))
    if not 0 <= np.fmin.reduce(values, initial=np.inf) <= np.fmax.reduce(values, initial=-np.inf) < CODES:
        return None
    values = values[np.isfinite(values)]
    return values if np.array_equal(values, np.rint(values)) else None


def _signed(values: Array) -> Array:
    return np.where(values >= NEGATIVE, values - CODES, values)


def _decoded(column: pl.Series) -> pl.Series:
    """A column whose codes from the middle of the range on are negative; text of it stays."""
    number = column.cast(pl.Float64, strict=False)
    signed = (number - CODES * (number >= NEGATIVE).cast(pl.Float64)).rename(column.name)
    if column.dtype != pl.String:
        return signed
    return pl.select(pl.coalesce(signed.cast(pl.String), column).alias(column.name)).to_series()
