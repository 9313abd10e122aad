"""Parquet; dates and durations become whole nanoseconds."""

from __future__ import annotations

import io
from pathlib import Path

import polars as pl

from gyrocal.errors import InputError, first_line
from gyrocal.recording.source import Source

MAGIC = b"PAR1"


def read(path: Path, file: Path | io.BytesIO) -> Source:
    """The table of a ``file``, which ``path`` names: its columns of numbers, times and text."""
    try:
        frame = pl.read_parquet(file)
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        raise InputError(f"{path}: not a readable Parquet file: {first_line(error)}") from None
    kept = []
    for name, dtype in frame.schema.items():
        if isinstance(dtype, pl.Datetime):
            kept.append(pl.col(name).dt.epoch("ns"))
        elif isinstance(dtype, pl.Duration):
            kept.append(pl.col(name).dt.total_nanoseconds())
        elif dtype.is_numeric() or dtype == pl.String:
            kept.append(pl.col(name))
    return Source(str(path), frame.select(kept))
