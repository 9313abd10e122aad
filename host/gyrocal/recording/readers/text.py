"""Tables as text: commas, semicolons (also with decimal commas), tabs or spaces; other lines may stand above the header."""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import polars as pl

from gyrocal.errors import InputError, first_line
from gyrocal.files import LONGEST_LINE, long_line
from gyrocal.recording.source import TOO_LONG, Source

HEADER_SEARCH_LINES = 200
BLANK = b"\n\0 "
BLANKS = BLANK.decode()
HEAD_BYTES = 1024
"""Bytes of a file's beginning, among which a text has no zero."""
TAIL_BYTES = 4096
"""Bytes of a file's end that are looked at in one step."""
MINUS = "\u2212".encode()
QUOTES = " \t\"'"
SEPARATORS = ",\t;| "
NUMBERS = b"0123456789.+-eE\n"
"""What a table is made of whose every cell is a number; with a comma that separates no cells, it is text."""
UNITS = r"n?s|[um]s|sec|(?:m?deg|m?d|rad|deg|°)/?(?:p?s|sec)|deg|rad|°|m?g|m/s\^?2|°?c|degc|k|counts?|lsb"
"""What a line of units below the columns' names is made of, in lower case."""
MONITOR = rb"(?m)^(\d\d:\d\d:\d\d\.\d{1,6}) *-?> *"
"""How a serial monitor stamps each line: ``12:01:02.345 -> 0.1,0.2,0.3`` of Arduino, ``>`` of PlatformIO."""
CLOCK = re.compile(r"\d:\d\d")
"""What a cell that holds a time of day has."""
EXACT = 2.0**53
"""A whole number from here on does not fit a float64: nanoseconds since 1970, say, which are counted from the first one."""


def read(path: Path, data: bytes, names: Sequence[str], columns: Sequence[str] | None, skip: int | None) -> Source:
    """The table in a text; its cells stay text, without quotes and blanks around them.

    The header is the line that holds all ``names``; without names, the line above the first two rows of numbers.
    """
    data = _plain(data)
    end = _end(data)
    if end == 0:
        raise InputError(f"{path}: the file is empty")
    if b"\0" in data[:HEAD_BYTES]:
        raise InputError(f"{path}: not a text, and of no known format; docs/importing.md lists them")
    if row := long_line(data, end):
        why = _why_no_table([data[:HEAD_BYTES].decode("utf-8", errors="replace")])
        raise InputError(f"{path}: row {row}: more than {LONGEST_LINE} bytes in one line ({why})")
    starts, lines = _first_lines(data, end, HEADER_SEARCH_LINES + (skip or 0) + 3)
    if columns is None:
        header, separator = _find_header(path, lines, names, skip) if names else _find_any_header(path, lines, skip)
        columns, first = _head(lines, header, separator), header + 1
    else:
        first, separator = _find_data(path, lines, columns, names, skip)
    for name in names:
        if list(columns).count(name) > 1:
            raise InputError(f"{path}: column {name!r} stands twice in the header")
    if first == len(lines):
        raise InputError(f"{path}: row {first + 1}: no samples")
    # the reader takes the number of columns from its first row, which is one wider than the table
    table = b"".join([len(columns) * separator.encode() + b"\n", memoryview(data)[starts[first] : end]])
    return Source(str(path), _frame(path, table, separator, list(columns), list(names)), first + 1)


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
    return re.sub(MONITOR + rb"(?=[^\W\d])", b"time" + separator, re.sub(MONITOR + rb"(?=\W*\d)", rb"\1" + separator, data))


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


def _frame(path: Path, body: bytes, separator: str, columns: list[str], names: list[str]) -> pl.DataFrame:
    """All rows of a table, whose first is a row of empty cells: as numbers where there are no others, else as text.

    A short row is filled up with empty cells, a long one is cut.
    """
    if separator == " ":
        width, _, rows = body.partition(b"\n")
        body = width + b"\n" + re.sub(rb"(?m)^ +| +$", b"", re.sub(rb"[ \t]+", b" ", rows))
    wanted = {name: str(columns.index(name)) for name in names or columns if name}
    if not body.translate(None, NUMBERS + separator.encode()):
        try:
            table, beyond = _parsed(body, separator, len(columns), dict.fromkeys(wanted.values(), pl.Float64()))
            numbers = table.select(pl.col(place).alias(name) for name, place in wanted.items())
            if not beyond.any() and all(_largest(c) < EXACT for c in numbers):
                return numbers
        except pl.exceptions.PolarsError:
            pass  # some cell is no number
    try:
        table, beyond = _parsed(body, separator, len(columns), {})
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        raise InputError(f"{path}: not a readable table: {first_line(error)}") from None
    if beyond.any():
        table = table.with_columns(pl.when(~beyond).then(pl.all()).otherwise(pl.lit(TOO_LONG)))
    cells = table.select(pl.col(place).str.strip_chars(QUOTES).alias(name) for name, place in wanted.items())
    if b"," in body:
        cells = cells.with_columns(pl.col(name).map_batches(_with_points) for name in cells.columns)
    return cells


def _with_points(cells: pl.Series) -> pl.Series:
    """Cells without separators of thousands and with decimal points; those that are of neither kind stay as they are."""
    for thousands, comma in ((",", "."), (".", ",")):
        grouped = cells.str.contains(rf"^[-+]?\d{{1,3}}(?:[{thousands}]\d{{3}})+[{comma}]\d*$")
        cells = cells.zip_with(~grouped.fill_null(False), cells.str.replace_all(thousands, "", literal=True))
    decimal = cells.str.contains(r"^[-+]?\d*,\d+(?:[eE][-+]?\d+)?$").fill_null(False)
    return cells.zip_with(~decimal, cells.str.replace(",", ".", literal=True))


def _parsed(body: bytes, separator: str, width: int, types: Mapping[str, pl.DataType]) -> tuple[pl.DataFrame, pl.Series]:
    """The cells by the column's place, as text but for the ``types`` given, and which rows have more than ``width`` cells."""
    schema = {place: types.get(place, pl.String()) for place in map(str, range(width + 1))}
    table = pl.read_csv(
        body, has_header=False, separator=separator, schema=schema, truncate_ragged_lines=True,
        quote_char='"' if b'"' in body else None, encoding="utf8-lossy",
    )[1:]  # fmt: skip
    last = table[str(width)]
    if last.null_count() == len(last):
        return table, pl.repeat(False, len(last), eager=True)
    return table, last.str.strip_chars(QUOTES).str.len_chars().fill_null(0) > 0


def _largest(column: pl.Series) -> float:
    """The largest size of a column's numbers; 0 if it has none."""
    low, high = column.min(), column.max()
    return max(-float(low), float(high)) if low is not None and high is not None else 0.0  # type: ignore[arg-type]


def _split(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    return next(csv.reader([line], delimiter=separator), []) if '"' in line else line.split(separator)


def _cells(line: str, separator: str) -> list[str]:
    return [cell.strip(QUOTES + "#") for cell in _split(line, separator)]


def _head(lines: list[str], number: int, separator: str) -> list[str]:
    """The columns' names in a line, each behind what the line above says of it if that line heads groups of columns.

    ``Gyroscope,,,Angle`` above ``X,Y,Z,deg`` gives ``Gyroscope X``, ``Gyroscope Y``, ``Gyroscope Z`` and ``Angle (deg)``.
    """
    own = _without_tail(_cells(lines[number], separator))
    above = _without_tail(_cells(lines[number - 1], separator)) if number else []
    single = len(set(own)) == len(own) and not all(re.fullmatch(UNITS, cell.lower()) for cell in own)
    if single or not 2 <= len(above) <= len(own) or any(map(_is_number, above)) or (all(above) and len(above) < len(own)):
        return own
    names, group = [], ""
    for i, cell in enumerate(own):
        alone = i < len(above) and above[i] != ""
        group = above[i] if alone else group
        unit = alone and re.fullmatch(UNITS, cell.lower()) is not None
        names.append(f"{group} ({cell})" if unit else f"{group} {cell}".strip())
    return names


def _without_tail(cells: list[str]) -> list[str]:
    """The cells without empty ones at the end: some programs end each line with a separator."""
    while cells and not cells[-1]:
        cells = cells[:-1]
    return cells


def _window(lines: list[str], skip: int | None) -> list[tuple[int, str]]:
    first, last = (0, HEADER_SEARCH_LINES) if skip is None else (skip, skip + 1)
    return list(enumerate(lines))[first:last]


def _shown(lines: list[str], skip: int | None) -> str:
    first = skip or 0
    return f"row {first + 1} is {(lines[first : first + 1] or ['nothing'])[0][:120]!r}"


def _find_header(path: Path, lines: list[str], names: Sequence[str], skip: int | None) -> tuple[int, str]:
    """The line that holds every wanted name, and the separator that shows them."""
    for number, line in _window(lines, skip):
        for separator in SEPARATORS:
            if set(names) <= set(_cells(line, separator)) or set(names) <= set(_head(lines, number, separator)):
                return number, separator
    where = "no line" if skip is None else f"row {skip + 1}"
    raise InputError(
        f"{path}: {where} names the columns {', '.join(dict.fromkeys(names))}; {_shown(lines, skip)} "
        "(other names: --map; no header: --columns a,b,c)"
    )


def _find_any_header(path: Path, lines: list[str], skip: int | None) -> tuple[int, str]:
    """The line above the first two rows of numbers, with the separator that makes most cells of it."""
    found = []
    for separator in SEPARATORS:
        rows = [(n, _cells(line, separator)) for n, line in enumerate(lines[: HEADER_SEARCH_LINES + 3]) if line.strip(BLANKS)]
        for (number, header), (_, row), (_, next_row) in zip(rows, rows[1:], rows[2:], strict=False):
            fits = len(_without_tail(header)) <= len(row) == len(next_row) > 1 and (skip is None or number == skip)
            fits = fits and len(header) >= len(_without_tail(row))
            fits = fits and not _is_number(header[0]) and not _mostly_numbers(header)
            if fits and _mostly_numbers(row) and _mostly_numbers(next_row):
                found.append((len(header), number, separator))
                break
    if not found:
        raise InputError(
            f"{path}: no header above rows of numbers; {_shown(lines, skip)} ({_why_no_table(lines)})"
        )
    _, number, separator = max(found, key=lambda f: f[0])
    return number, separator


def _why_no_table(lines: list[str]) -> str:
    """What to do with a text in which no table is found."""
    start = lines[0].lstrip()[:1]
    if start in ("{", "["):
        return "this is JSON; save it as CSV, as pandas.read_json(FILE, lines=True).to_csv does"
    if start == "<":
        return "this is XML or HTML; save the table in it as CSV"
    head = max((_cells(lines[0], separator) for separator in SEPARATORS), key=len)
    if len(lines) < 3 and len(head) > 1 and not _mostly_numbers(head):
        rows = "1 row" if len(lines) == 2 else "no rows"
        return f"{rows} below the header; a recording has two samples at least"
    last = lines[-1]
    if last.count(",") + 1 == 2 * len(_without_tail(_cells(lines[0], ","))) > 2:
        return "decimal commas and commas between the cells look alike; save it with semicolons or tabs between the cells"
    if re.search(r"\b0[xX][0-9a-fA-F]+\b", last):
        return "hexadecimal numbers are not read; write decimal ones"
    if labelled := re.search(r"[A-Za-z]\w*[:=]\s*[-+.\d]+", last):
        return f"its cells hold names, as {labelled[0]!r}; write the names once, in the first line, and numbers below"
    return "no header: name all columns, as by --columns time,gx,gy,gz; else name the columns by --map"


def _find_data(path: Path, lines: list[str], columns: Sequence[str], names: Sequence[str], skip: int | None) -> tuple[int, str]:
    """The first line that has as many cells as there are names, numbers where numbers are wanted; and the separator."""
    wanted = [i for i, column in enumerate(columns) if column in (names or columns)]
    for number, line in _window(lines, skip):
        for separator in SEPARATORS:
            cells = _cells(line, separator)
            if len(cells) == len(columns) and all(_is_number(cells[i], True) or CLOCK.search(cells[i]) for i in wanted):
                return number, separator
    named = ", ".join(dict.fromkeys(names or columns))
    raise InputError(f"{path}: no row of {len(columns)} cells with numbers in {named}; {_shown(lines, skip)}")


def _mostly_numbers(cells: list[str]) -> bool:
    """True if more cells hold numbers than words. Cells are empty where a slower sensor of the same table has none."""
    return 2 * sum(map(_is_number, cells)) > sum(cell != "" for cell in cells)


def _is_number(cell: str, empty: bool = False) -> bool:
    try:
        float(cell.replace(",", ".") or ("0" if empty else "-"))
    except ValueError:
        return False
    return True
