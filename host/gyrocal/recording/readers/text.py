"""Tables as text: commas, semicolons (also with decimal commas), tabs or spaces; other lines may stand above the header."""

from __future__ import annotations

import codecs
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from gyrocal.errors import InputError, first_line
from gyrocal.files import LONGEST_LINE, long_line
from gyrocal.recording.one_sensor import named_as_sensor, of_gyroscopes
from gyrocal.recording.readers import layout as layouts
from gyrocal.recording.readers.layout import BLANKS, HEADER_SEARCH_LINES, MARK, QUOTES, Layout, is_number
from gyrocal.recording.source import MOST_DAMAGED, OTHER_WIDTH, Source

BLANK = BLANKS.encode()
HEAD_BYTES = 1024
"""Bytes of a file's beginning, among which a text has no zero."""
TAIL_BYTES = 4096
"""Bytes of a file's end that are looked at in one step."""
FIRST_ROWS = 64
"""Rows in which each of several sensors has its turn."""
MINUS = "\u2212".encode()
Booleans = np.ndarray[Any, np.dtype[np.bool_]]
Index = np.ndarray[Any, np.dtype[np.intp]]
NUMBERS = b"0123456789.+-eE\n"
"""What a table is made of whose every cell is a number; with a comma that separates no cells, it is text."""
MONITOR = rb"(?m)^(\d\d:\d\d:\d\d\.\d{1,6}) *-?> *"
"""How a serial monitor stamps each line: ``12:01:02.345 -> 0.1,0.2,0.3`` of Arduino, ``>`` of PlatformIO."""
EXACT = 2.0**53
"""A whole number from here on does not fit a float64: nanoseconds since 1970, say, which are counted from the first one."""


def read(
    path: Path, data: bytes, names: Sequence[str], columns: Sequence[str] | None, skip: int | None, option: str = "--"
) -> Source:
    """The table in a text; its cells stay text, without quotes and blanks around them.

    The header is the line that holds all ``names``; without names, the line above the first two rows of numbers. ``option`` is
    what the options begin with that an error names.
    """
    data = _plain(data)
    end = _end(data)
    if end == 0:
        raise InputError(f"{path}: the file is empty")
    if b"\0" in data[:HEAD_BYTES]:
        known = "CSV, Parquet, .npz, .mat, a ROS bag, MCAP, ULog"
        raise InputError(f"{path}: not a text, and of no known format ({known}); save it as one of these")
    if row := long_line(data, end):
        why = layouts.why_no_table([data[:HEAD_BYTES].decode("utf-8", errors="replace")], option)
        raise InputError(f"{path}: row {row}: more than {LONGEST_LINE} bytes in one line ({why})")
    starts, lines = _first_lines(data, end, HEADER_SEARCH_LINES + (skip or 0) + 3)
    if columns is None:
        layout = layouts.find(path, lines, names, skip, option)
    else:
        layout = layouts.find_rows(path, lines, columns, names, skip, option)
    for name in names:
        if layout.names.count(name) > 1:
            raise InputError(f"{path}: column {name!r} stands twice in the header")
    if layout.first == len(lines):
        raise InputError(f"{path}: row {layout.first + 1}: no samples")
    sensors = [name for name in layout.names if name and named_as_sensor(name)] if names else []
    cells = _frame(path, memoryview(data)[starts[layout.first] : end], layout, list(dict.fromkeys((*names, *sensors))), option)
    asked = list(dict.fromkeys(names)) or cells.columns
    frame, beside = cells.select(asked), cells.drop(asked)
    above = tuple(line for line in lines[: layout.first] if not layouts.is_header(line, layout))
    return Source(str(path), frame, layout.first + 1, names=tuple(layout.names), beside=beside, above=above)


def _plain(data: bytes) -> bytes:
    """A text in UTF-8 with lines that end in a line feed and the minus sign of a keyboard."""
    if (encoding := _utf16(data[:HEAD_BYTES])) is not None:
        data = data.decode(encoding, errors="replace").encode()
    data = data.removeprefix(codecs.BOM_UTF8)
    for old, new in ((b"\r\n", b"\n"), (b"\r", b"\n"), (MINUS, b"-")):
        if old in data:
            data = data.replace(old, new)
    return _of_monitor(data)


def _utf16(head: bytes) -> str | None:
    """The UTF-16 of a text by its first bytes, with a byte order mark or without: every other byte is then zero."""
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    zeros = [not any(head[first::2]) and len(head) > 1 for first in (0, 1)]
    text = [b"\0" not in head[1 - first :: 2] for first in (0, 1)]
    return next((name for name, z, t in zip(("utf-16-be", "utf-16-le"), zeros, text, strict=True) if z and t), None)


def _of_monitor(data: bytes) -> bytes:
    """A text in which a serial monitor's stamps are a column ``time``; any other text as it is."""
    if re.match(MONITOR, data) is None:
        return data
    last = data[data.rstrip(BLANK).rfind(b"\n") + 1 :]
    separator = next((s.encode() for s in ",\t;|" if s.encode() in last), b" ")
    stamped = re.sub(MONITOR + rb"(?=\W*\d)", rb"\1" + separator, data)
    return re.sub(MONITOR + rb"(?:[#%;/]+ *)?(?=[^\W\d])", b"time" + separator, stamped)


def _end(data: bytes) -> int:
    """The length of a text without blank lines, blanks and zeros at its end. (``rstrip`` would copy the text.)"""
    end = len(data)
    while end:
        start = max(0, end - TAIL_BYTES)
        if tail := data[start:end].rstrip(BLANK):
            return start + len(tail)
        end = start
    return 0


def _first_lines(data: bytes, end: int, most: int) -> tuple[list[int], list[str]]:
    """Where each of the first lines starts, and its text."""
    starts: list[int] = []
    lines: list[str] = []
    start = 0
    while start < end and len(lines) < most:
        stop = data.find(b"\n", start, end)
        stop = end if stop < 0 else stop
        starts.append(start)
        lines.append(data[start:stop].decode("utf-8", errors="replace"))
        start = stop + 1
    return starts, lines


def _frame(path: Path, rows: memoryview, layout: Layout, names: list[str], option: str) -> pl.DataFrame:
    """All rows of a table: as numbers where there are no others, else as text. Comments and lines of blanks are blank lines.

    The cells of a row with another number of cells are ``OTHER_WIDTH``, unless it is a line of text without a number. A column
    whose first cells have words for gyroscopes is taken beside those of ``names``.
    """
    separator, columns = layout.separator, layout.names
    # the reader takes the number of columns from its first row, which is one wider than the table
    body = b"".join([layout.width * separator.encode(), b"\n", rows])
    numeric = not body.translate(None, NUMBERS + separator.encode())
    if not numeric:
        body = re.sub(rb"\n[ \t]+(?=\n|\Z)", b"\n", _without_comments(body, separator))
    if separator == " ":
        width, _, blank = body.partition(b"\n")
        body = width + b"\n" + re.sub(rb"(?m)^ +| +$", b"", re.sub(rb"[ \t]+", b" ", blank))
    wanted = {name: str(columns.index(name)) for name in names or columns if name}
    if numeric:
        try:
            table = _parsed(body, separator, layout.width, dict.fromkeys(wanted.values(), pl.Float64()))
            numbers = table.select(pl.col(place).alias(name) for name, place in wanted.items())
            odd = not _is_even(body, table, layout) and _of_other_width(path, body, table, layout, option).any()
            if not odd and all(_largest(c) < EXACT for c in numbers):
                return numbers
        except pl.exceptions.PolarsError:
            pass  # some cell is no number
    try:
        table = _parsed(body, separator, layout.width, {})
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        raise InputError(f"{path}: not a readable table: {first_line(error)}") from None
    heads = {name: str(place) for place, name in enumerate(columns[: layout.width]) if name and name not in wanted}
    wanted |= {name: k for name, k in heads.items() if of_gyroscopes(table[k].head(FIRST_ROWS).str.strip_chars(QUOTES))}
    if not _is_even(body, table, layout):
        other = pl.Series(_of_other_width(path, body, table, layout, option))
        table = table.with_columns(pl.when(~other).then(pl.all()).otherwise(pl.lit(OTHER_WIDTH)))
    cells = table.select(pl.col(place).str.strip_chars(QUOTES).alias(name) for name, place in wanted.items())
    if b"," in body:
        cells = cells.with_columns(pl.col(name).map_batches(_with_points) for name in cells.columns)
    return cells


def _without_comments(body: bytes, separator: str) -> bytes:
    """The rows with blank lines in place of comments."""
    marks = [mark for mark in (b"#", b"%", b"//", b";") if mark in body and mark != separator.encode()]
    if not marks:
        return body
    mark = MARK.pattern.removeprefix("^").encode()
    other = b"(?!;)" if separator == ";" else b""
    return re.sub(rb"(?m)^[ \t\"']*" + other + mark + rb".*$", b"", body)


def _is_even(body: bytes, table: pl.DataFrame, layout: Layout) -> bool:
    """True if it is seen at once that every row has the table's number of cells, each with a name.

    A row whose last cell is not empty has that many at least, so the number of all separators decides.
    """
    width = layout.width
    if len(layout.names) < width or table[str(width - 1)].null_count() or b'"' in body:
        return False
    return width == 1 or body.count(layout.separator.encode()) == width + table.height * (width - 1)


def _of_other_width(path: Path, body: bytes, table: pl.DataFrame, layout: Layout, option: str) -> Booleans:
    """The rows [n] that hold numbers and another number of cells than the table, or cells beyond those with a name.

    InputError where they are more than a few, or where quotation marks do not pair.
    """
    ends, widths = _cells_by_line(body, layout.separator)
    if widths.size != table.height:
        raise InputError(f"{path}: its quotation marks do not pair; remove them, or close each of them in its own row")
    beyond = [table[str(k)].str.strip_chars(QUOTES).fill_null("") != "" for k in range(len(layout.names), layout.width)]
    blank = table.select(pl.all_horizontal(pl.all().is_null())).to_series().to_numpy()
    odd = ((widths != layout.width) & ~blank) | np.any([b.to_numpy() for b in beyond] or [np.zeros(blank.size, bool)], axis=0)
    for k in np.flatnonzero(odd):
        line = body[ends[k] + 1 : ends[k + 1]].decode("utf-8", errors="replace")
        odd[k] = any(is_number(cell.strip(QUOTES)) for cell in layouts.split(line, layout.separator))
    count, total = int(odd.sum()), int((~blank).sum())
    if count > MOST_DAMAGED * total:
        row = int(np.flatnonzero(odd)[0])
        drawn = np.linspace(0, ends.size - 2, HEADER_SEARCH_LINES).astype(int)  # the rows of a kind may follow another's
        lines = [body[ends[k] + 1 : ends[k + 1]].decode("utf-8", errors="replace") for k in np.unique(drawn)]
        if several := layouts.several_kinds(lines):
            raise InputError(f"{path}: row {layout.first + 1 + row}: {several}")
        raise InputError(
            f"{path}: row {layout.first + 1 + row}: {widths[row]} cells, and the table has {layout.width} in a row; {count} of "
            f"{total} rows are so. Correct or delete these rows, or {layouts.naming(option)}"
        )
    return odd


def _cells_by_line(body: bytes, separator: str) -> tuple[Index, Index]:
    """Where the lines end [n + 1], and how many cells each after the first has [n]; what stands in quotes separates nothing."""
    letters = np.frombuffer(body if body.endswith(b"\n") else body + b"\n", dtype=np.uint8)
    stops, cuts = letters == ord("\n"), letters == ord(separator)
    if b'"' in body:
        outside = np.cumsum(letters == ord('"'), dtype=np.uint8) % 2 == 0  # a sum that overflows stays even or odd
        stops, cuts = stops & outside, cuts & outside
    ends = np.flatnonzero(stops)
    return ends, np.diff(np.searchsorted(np.flatnonzero(cuts), ends)) + 1


def _with_points(cells: pl.Series) -> pl.Series:
    """Cells without separators of thousands and with decimal points; those that are of neither kind stay as they are."""
    for thousands, comma in ((",", "."), (".", ",")):
        grouped = cells.str.contains(rf"^[-+]?\d{{1,3}}(?:[{thousands}]\d{{3}})+[{comma}]\d*$")
        cells = cells.zip_with(~grouped.fill_null(False), cells.str.replace_all(thousands, "", literal=True))
    decimal = cells.str.contains(r"^[-+]?\d*,\d+(?:[eE][-+]?\d+)?$").fill_null(False)
    return cells.zip_with(~decimal, cells.str.replace(",", ".", literal=True))


def _parsed(body: bytes, separator: str, width: int, types: Mapping[str, pl.DataType]) -> pl.DataFrame:
    """The first ``width`` cells of each row by the column's place, as text but for the ``types`` given."""
    schema = {place: types.get(place, pl.String()) for place in map(str, range(width + 1))}
    return pl.read_csv(
        body, has_header=False, separator=separator, schema=schema, truncate_ragged_lines=True,
        quote_char='"' if b'"' in body else None, encoding="utf8-lossy",
    )[1:]  # fmt: skip


def _largest(column: pl.Series) -> float:
    """The largest size of a column's numbers; 0 if it has none."""
    low, high = column.min(), column.max()
    return max(-float(low), float(high)) if low is not None and high is not None else 0.0  # type: ignore[arg-type]
