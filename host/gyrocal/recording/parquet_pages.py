"""Numbers of values in the pages of a Parquet file, checked before Polars believes them.

A page that states a negative number of values makes Polars ask for 2^61 bytes, which ends the process and not only the reading.
The file's footer and the pages' headers are in Thrift's compact protocol (Apache Parquet format, parquet.thrift).
"""

from __future__ import annotations

from collections.abc import Iterator
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any, BinaryIO

import polars as pl

TRUE, FALSE, BYTE, BINARY, LISTS, STRUCT = 1, 2, 3, 8, (9, 10), 12
INTEGERS, DOUBLE = (4, 5, 6), 7
PAGE_HEADERS = (5, 7, 8)
"""Fields of a page's header that hold the header of a data, a dictionary or a second-version data page."""
DEEPEST = 20

Struct = dict[int, Any]
Data = bytes | mmap


class _Compact:
    """Reads structures as dictionaries from the numbers of their fields; what it skips is None."""

    def __init__(self, data: Data, at: int) -> None:
        self.data, self.at = data, at

    def struct(self, depth: int = 0) -> Struct:
        found: Struct = {}
        number = 0
        while head := self._byte():
            number = number + (head >> 4) if head >> 4 else self._integer()
            found[number] = self._value(head & 15, depth)
        return found

    def _value(self, kind: int, depth: int) -> Any:
        if depth > DEEPEST:
            raise ValueError("nested too deeply")
        if kind in (TRUE, FALSE):
            return kind == TRUE
        if kind in INTEGERS:
            return self._integer()
        if kind in LISTS:
            head = self._byte()
            size = head >> 4 if head >> 4 < 15 else self._varint()
            return [self._byte() if head & 15 in (TRUE, FALSE) else self._value(head & 15, depth + 1) for _ in range(size)]
        if kind == STRUCT:
            return self.struct(depth + 1)
        if kind not in (BYTE, BINARY, DOUBLE):
            raise ValueError("an unknown type")
        skipped = {BYTE: 1, DOUBLE: 8}.get(kind) or self._varint()
        self.at += skipped
        return None

    def _byte(self) -> int:
        self.at += 1
        return self.data[self.at - 1]

    def _varint(self) -> int:
        value = shift = 0
        while (byte := self._byte()) & 128:
            value, shift = value | (byte & 127) << shift, shift + 7
        return value | byte << shift

    def _integer(self) -> int:
        value = self._varint()
        return value >> 1 ^ -(value & 1)


def read_parquet(source: Path | BinaryIO) -> pl.DataFrame:
    """The table of a Parquet file. Raises OSError, PolarsError or PanicException if it cannot be read."""
    if not isinstance(source, Path):
        content = source.read()
        _check(content)
        return pl.read_parquet(content)
    if source.stat().st_size:  # an empty file cannot be mapped
        with source.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as data:
            _check(data)
    return pl.read_parquet(source)


def _check(data: Data) -> None:
    """Refuse pages that state more values than their column or fewer than none. What is not understood is left to Polars."""
    try:
        footer = _Compact(data, len(data) - 8 - int.from_bytes(data[-8:-4], "little")).struct()
        chunks = [chunk[3] for group in footer[4] for chunk in group[1]]
        sound = all(0 <= n <= chunk[5] for chunk in chunks for n in _numbers(data, chunk))
    except (AttributeError, IndexError, KeyError, TypeError, ValueError):
        return
    if not sound:
        raise pl.exceptions.ComputeError("a page states an impossible number of values")


def _numbers(data: Data, chunk: Struct) -> Iterator[int]:
    """The number of values that each page of a column states."""
    first = min(of for of in (chunk.get(11), chunk[9]) if of)
    reader = _Compact(data, first)
    while reader.at < first + chunk[7]:
        page = reader.struct()
        yield from (page[field][1] for field in PAGE_HEADERS if field in page)
        reader.at += max(0, page[3])
