"""Where the table of a text lies: its header, the separator of its cells, and how many of them a row has.

A header names each cell of the rows below it, in order. Three differences are tolerated, each by a rule of its own: a mark of a
comment before the header (``# t gx gy gz``) is no cell; the first column may have no name, as an index has none, where the
header holds an empty cell for it (``,t,gx,gy,gz``); and the same empty cells may stand at the end of all rows or of the header,
as separators at the end of lines make them. Any other difference is refused, because nobody knows which name belongs to which
cell.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from gyrocal.errors import InputError
from gyrocal.recording.one_sensor import OF_GYROSCOPES

HEADER_SEARCH_LINES = 200
ROWS_LOOKED_AT = 20
"""Rows below a header whose cells are counted; most of them have the table's number."""
BLANKS = "\n\0 "
QUOTES = " \t\"'"
SEPARATORS = ",\t;| "
WITH_COLUMNS = ("--", "--ref-")
"""What the options begin with of the files whose columns an option of their own names."""
OF_A_REFERENCE: Sequence[Sequence[str]] = (
    ("time", "x", "y", "z", "qx", "qy", "qz", "qw"), ("time", "qx", "qy", "qz", "qw"),
    ("time", "wx_dps", "wy_dps", "wz_dps"), ("time", "angle_deg"),
)  # fmt: skip
"""Names of a reference's columns in examples, the longest first."""
MARK = re.compile(r"^(?:#+(?!(?:N/A|DIV/0!|NAME\?|NULL!|NUM!|REF!|VALUE!))|%+|//+|;+)")
"""A mark of a comment at the beginning of a line. What a spreadsheet writes for an error begins with such a character too."""
UNITS = r"n?s|[um]s|sec|(?:m?deg|m?d|rad|deg|°)/?(?:p?s|sec)|deg|rad|°|m?g|m/s\^?2|°?c|degc|k|counts?|lsb"
"""What a line of units below the columns' names is made of, in lower case."""
BRACKETED = re.compile(r"\[\S*\]|\(\S*\)")
"""A unit in brackets."""
DECIMAL_COMMAS = "decimal commas and commas between the cells look alike; save it with semicolons or tabs between the cells"
EMPTY_BY_TABS = re.compile(r"\t *\t|^ *\t")
FIRST_CELLS = 3
"""Cells of a row among which one names its kind, as after a time."""
HEXADECIMAL = r"(?:[0-9a-f]{4}|[0-9a-f]{8}|[0-9A-F]{4}|[0-9A-F]{8})"
"""A word of 16 or 32 bits without a mark of its base."""
HEXADECIMAL_CELLS = (
    "hexadecimal numbers are not read; write decimal ones: words of 4 or 8 digits are whole numbers with a sign, or 8 the bits "
    "of a float (struct.unpack('>f', bytes.fromhex(CELL)))"
)
LABELLED = re.compile(r"[A-Za-z]\w*(?: ?=|:)\s*[(\[]?[-+.\d]+")
"""A number with its name before it."""
CLOCK = re.compile(r"\d:\d\d")
"""What a cell that holds a time of day has."""


@dataclass(frozen=True)
class Layout:
    """``names`` of the columns in order, the number of cells in a row (``width``), and the place of the first row, from 0."""

    names: list[str]
    width: int
    first: int
    separator: str


@dataclass(frozen=True)
class _Mismatch:
    """A header whose cells are not those of the rows below it: ``row`` is the first of these, ``why`` says it in words.

    A comment in words (``is_prose``) is no header.
    """

    head: list[str]
    row: int
    why: str
    is_prose: bool

    def error(self, path: Path, option: str) -> InputError:
        """The refusal, which names the option that states the columns."""
        advice = f"; correct the header, or {naming(option)}"
        return InputError(f"{path}: row {self.row + 1}: {self.why}{'' if DECIMAL_COMMAS in self.why else advice}")


def find(path: Path, lines: Sequence[str], names: Sequence[str], skip: int | None, option: str) -> Layout:
    """The layout of a table by its first lines. Its header holds all ``names``; without names, it is above two rows of numbers.

    ``skip``: the number of lines above the header. ``option``: what the options begin with that an error names.
    """
    mismatch: _Mismatch | None = None
    for found in _named(lines, names, skip) if names else _unnamed(lines, skip):
        if isinstance(found, Layout):
            return found
        mismatch = mismatch or found
    if mismatch is not None:
        raise mismatch.error(path, option)
    if not names:
        row = _labelled(lines)
        shown = _shown(lines, skip if row is None else row)
        raise InputError(f"{path}: no header above rows of numbers; {shown} ({why_no_table(lines, option)})")
    where = "no line" if skip is None else f"row {skip + 1}"
    raise InputError(
        f"{path}: {where} names the columns {', '.join(dict.fromkeys(names))}; {_shown(lines, skip)} "
        f"(other names: {option if option in WITH_COLUMNS else '--'}map; no header: {naming(option)})"
    )


def find_rows(
    path: Path, lines: Sequence[str], columns: Sequence[str], names: Sequence[str], skip: int | None, option: str
) -> Layout:
    """The layout of a table whose ``columns`` are stated, from the first row that has as many cells and the wanted numbers.

    Where no names are wanted, most cells hold numbers: a column may hold words, such as a date or the kind of the row.
    """
    wanted = [i for i, column in enumerate(columns) if column in names]
    counted: Counter[int] = Counter()
    for number, line in _window(lines, skip):
        for separator in SEPARATORS:
            cells = _cells(line, separator)
            if not _holds_row(line, separator) or len(cells) < len(columns) or any(cells[len(columns) :]):
                counted[len(cells)] += len(cells) > 1 and mostly_numbers(cells)
            elif all(is_number(cells[i], True) or CLOCK.search(cells[i]) for i in wanted) and (wanted or mostly_numbers(cells)):
                rows = _rows_below(lines, number - 1, separator)
                if _width(rows) == len(cells):
                    return Layout(list(columns), len(cells), number, separator)
    if several := several_kinds(lines):
        raise InputError(f"{path}: no row of {len(columns)} cells with numbers: {several}")
    named = ", ".join(dict.fromkeys(names or columns))
    if (row := _labelled(lines)) is not None:
        shown = f"{_shown(lines, row)} ({why_no_table(lines, option)})"
        raise InputError(f"{path}: no row of {len(columns)} cells with numbers in {named}; {shown}")
    most = counted.most_common(1)
    if (why := why_no_table(lines, option)) == HEXADECIMAL_CELLS:
        raise InputError(f"{path}: no row of {len(columns)} cells with numbers in {named}; {_shown(lines, skip)} ({why})")
    other = f"most rows have {most[0][0]} cells: name as many; " if most and most[0][1] and most[0][0] != len(columns) else ""
    raise InputError(f"{path}: no row of {len(columns)} cells with numbers in {named}; {other}{_shown(lines, skip)}")


def is_header(line: str, layout: Layout) -> bool:
    """True if a line has as many cells as a table's rows, or one more, which may be the mark of a comment."""
    return len(_cells(line, layout.separator)) - layout.width in (0, 1)


def is_comment(line: str, separator: str) -> bool:
    """True if a line begins with a mark of a comment; the separator of the cells is none."""
    return MARK.match(line.lstrip(QUOTES)) is not None and line.lstrip(QUOTES)[0] != separator


def split(line: str, separator: str) -> list[str]:
    """The cells of a line as they are written. Blanks separate no cells where tabs stand about an empty one."""
    if separator == " ":
        return [line] if EMPTY_BY_TABS.search(line) else line.split()
    return next(csv.reader([line], delimiter=separator), []) if '"' in line else line.split(separator)


def is_number(cell: str, empty: bool = False) -> bool:
    """True if a cell holds a number, also with a decimal comma; for an empty one, ``empty``."""
    try:
        float(cell.replace(",", ".") or ("0" if empty else "-"))
    except ValueError:
        return False
    return True


def mostly_numbers(cells: Sequence[str]) -> bool:
    """True if more cells hold numbers than words. Cells are empty where a slower sensor of the same table has none."""
    return 2 * sum(map(is_number, cells)) > sum(cell != "" for cell in cells)


def why_no_table(lines: Sequence[str], option: str = "--") -> str:
    """What to do with a text in which no table is found."""
    start = lines[0].lstrip()[:1]
    if start in ("{", "["):
        return _why_json(lines)
    if start == "<":
        return "this is XML or HTML; save the table in it as CSV"
    head = max((_cells(lines[0], separator) for separator in SEPARATORS), key=len)
    if len(lines) < 3 and len(head) > 1 and not mostly_numbers(head):
        rows = "1 row" if len(lines) == 2 else "no rows"
        return f"{rows} below the header; a recording has two samples at least"
    if several := several_kinds(lines):
        return several
    last = lines[-1]
    if last.count(",") + 1 == 2 * len(_without_tail(_cells(lines[0], ","))) > 2:
        return DECIMAL_COMMAS
    cells = max((_cells(last, separator) for separator in SEPARATORS), key=len)
    if sum(re.fullmatch(r"[-+]?0[xX][0-9a-fA-F]+", cell) is not None for cell in cells) > 1:
        return "hexadecimal numbers are not read; write decimal ones"
    words = [cell for cell in cells if not is_number(cell)]
    of_letters = len(words) == 1 and words[0].isalpha()  # the kind of a row, as ACCE
    if words and len(cells) > 1 and not of_letters and all(re.fullmatch(HEXADECIMAL, word) for word in words):
        return HEXADECIMAL_CELLS
    if (row := _labelled(lines)) is not None and (labelled := re.search(LABELLED, lines[row])):
        return f"its cells hold names, as {labelled[0]!r}; write the names once, in the first line, and numbers below"
    if option not in WITH_COLUMNS:
        return f"no header: {naming(option)}"
    example = _example(len(cells), option)
    return f"no header: name all columns, as by {option}columns {example}; else name the columns by {option}map"


def _example(count: int, option: str = "--") -> str:
    """As many names as a table has columns, as an example: a time, a gyroscope, an accelerometer.

    A reference's is of a pose, an orientation, three rates or an angle, each with a time.
    """
    if option == "--ref-":
        pose = next(names for names in OF_A_REFERENCE if len(names) <= max(count, 2))
        return ",".join([*pose, *(f"c{k}" for k in range(len(pose) + 1, count + 1))])
    sensors = ["gx", "gy", "gz", "ax", "ay", "az"]
    if count in (3, 6):  # without a time
        return ",".join(sensors[:count])
    known = ["time", *sensors][:count]
    if count > 2 * len(known):
        return f"{','.join(known)},... ({count} names)"
    return ",".join([*known, *(f"c{k}" for k in range(len(known) + 1, count + 1))])


def naming(option: str) -> str:
    """How all columns of a file are named: a joined file by the option that gives it, one of a folder in the file itself."""
    if option in WITH_COLUMNS:
        return f"name all columns in their order by {option}columns a,b,c"
    if option:
        return f"name all columns in their order behind the file: {option}FILE:time,ax,ay,az"
    return "write the names of its columns into a line above them, as time,ax,ay,az"


def _why_json(lines: Sequence[str]) -> str:
    """What to do with JSON: objects one a line, a list, one object that holds the readings, or the dictionaries of Python."""
    if re.match(r"[{\[ ]*'", lines[0]):
        rows = "[ast.literal_eval(line) for line in open(FILE)]"
        return f"these are dictionaries of Python; save them as CSV, as pandas.json_normalize({rows}).to_csv does"
    if lines[0].lstrip().startswith("["):
        return "this is JSON; save it as CSV, as pandas.json_normalize(json.load(open(FILE))).to_csv does"
    if len(lines) > 1 and all(line.strip().startswith("{") for line in lines[:2]):
        rows = "[json.loads(line) for line in open(FILE)]"
        return f"this is JSON, an object a line; save it as CSV, as pandas.json_normalize({rows}).to_csv does"
    keys = re.match(r'(?:\s*\{\s*"\w+"\s*:)+\s*\[', "\n".join(lines[:ROWS_LOOKED_AT]))
    place = "".join(f"[{key!r}]" for key in re.findall(r'"(\w+)"', keys[0])) if keys else ""
    where = f" (json.load(open(FILE)){place} is a list in it)" if place else ""
    return f"this is JSON, one object that holds all readings{where}; write a CSV with a row for each sample"


def _labelled(lines: Sequence[str]) -> int | None:
    """The place of the last line whose cells hold names beside their numbers; None where there is none.

    Lines of another kind may stand between, hence the last ones are looked at. A date with a time of day looks like one name.
    """
    for number in range(len(lines) - 1, max(-1, len(lines) - 1 - ROWS_LOOKED_AT), -1):
        line = lines[number]
        dated = CLOCK.search(line) is not None
        if not is_comment(line, ",") and len(re.findall(LABELLED, line)) > dated:
            return number
    return None


def several_kinds(lines: Sequence[str]) -> str:
    """What to do with rows of several kinds and widths, each with its kind in one of its first cells; empty for other rows."""
    for separator in SEPARATORS:
        rows = [_cells(line, separator) for line in lines if _holds_row(line, separator)]
        for place in range(FIRST_CELLS):
            named = [row for row in rows if len(row) > place + 1 and re.fullmatch(r"[A-Za-z]\w*", row[place])]
            counted = Counter(row[place] for row in named if mostly_numbers(row[:place] + row[place + 1 :]))
            kinds = [kind for kind, count in counted.most_common() if count > 1]
            of_kinds = [row for row in named if row[place] in kinds]
            gyroscopes = [kind for kind in kinds if re.fullmatch(OF_GYROSCOPES, kind)]
            apart = gyroscopes or len(set(map(len, of_kinds))) > 1
            if 1 < len(kinds) <= len(of_kinds) / 4 and 2 * len(of_kinds) > len(rows) and apart:
                numbers = Counter({kind: max(len(row) for row in of_kinds if row[place] == kind) for kind in kinds})
                kind = (gyroscopes or [numbers.most_common(1)[0][0]])[0]
                return (
                    f"rows are of several kinds, named in cell {place + 1}: {', '.join(kinds)}. Keep the rows of one kind in a "
                    f"file of their own, as {kind}, and name all columns of it in their order"
                )
    return ""


def _named(lines: Sequence[str], names: Sequence[str], skip: int | None) -> Iterator[Layout | _Mismatch]:
    """The lines that hold every wanted name, each as the header of what is below it."""
    for number, line in _window(lines, skip):
        for separator in SEPARATORS:
            names_of_line = _names(line, separator)
            for head in (names_of_line, *_with_units(names_of_line, separator), *_grouped(lines, number, separator)):
                if set(names) <= set(head):
                    yield _below(lines, number, separator, [head])


def _unnamed(lines: Sequence[str], skip: int | None) -> Iterator[Layout | _Mismatch]:
    """The headers above two rows of numbers, those with most cells first; then the mismatches."""
    found: list[Layout] = []
    mismatched: list[_Mismatch] = []
    for separator in SEPARATORS:
        first: _Mismatch | None = None
        for row in _starts_of_numbers(lines, separator):
            above = [_below(lines, number, separator) for number in _headers_above(lines, row, separator, skip)]
            fits = next((a for a in above if isinstance(a, Layout)), None)
            if fits is not None:
                found.append(fits)
                break
            off = (a for a in above if isinstance(a, _Mismatch) and len(a.head) > 1 and not a.is_prose)
            first = first or next(off, None)
        else:
            mismatched += [first] if first is not None else []
    yield from sorted(found, key=lambda f: len(f.names), reverse=True)
    yield from sorted(mismatched, key=lambda m: len(m.head), reverse=True)


def _starts_of_numbers(lines: Sequence[str], separator: str) -> Iterator[int]:
    """The places of lines with which rows of numbers begin, two at least."""
    rows = [(n, _cells(line, separator)) for n, line in enumerate(lines) if _holds_row(line, separator)]
    numbers = [len(cells) > 1 and mostly_numbers(cells) for _, cells in rows]
    for k in range(len(rows) - 1):
        if numbers[k] and numbers[k + 1] and not (k and numbers[k - 1]):
            yield rows[k][0]


def _headers_above(lines: Sequence[str], row: int, separator: str, skip: int | None) -> Iterator[int]:
    """The places of what may be the header of a row: the comments above it, from below, and the line above these."""
    for number in range(row - 1, -1, -1):
        line = lines[number]
        if not line.strip(BLANKS):
            continue
        if _is_of_units(_cells(line, separator)) and not _grouped(lines, number, separator):
            continue
        if skip in (None, number) and number < HEADER_SEARCH_LINES and not _is_of_numbers(_names(line, separator)):
            yield number
        if not is_comment(line, separator):
            return


def _is_of_numbers(cells: Sequence[str]) -> bool:
    return not cells or is_number(cells[0]) or mostly_numbers(cells)


def _below(
    lines: Sequence[str], number: int, separator: str, heads: Sequence[list[str]] | None = None
) -> Layout | _Mismatch:
    """The table below a header, whose names are read in one of several ways."""
    names = _names(lines[number], separator)
    heads = heads or [*_grouped(lines, number, separator), *_with_units(names, separator), names]
    first = number + 1
    below = [n for n in range(first, len(lines)) if lines[n].strip(BLANKS)]
    if below and _is_of_units(_cells(lines[below[0]], separator)):
        first = below[0] + 1
    rows = _rows_below(lines, first - 1, separator)
    if not rows:
        return Layout(_without_tail(heads[0]), max(1, len(_without_tail(heads[0]))), first, separator)
    width = _width(rows)
    usual = [(n, cells) for n, cells in rows if len(cells) == width]
    for head in heads:
        if _fits(head, width, [cells for _, cells in usual]):
            return Layout(_without_tail(head), width, first, separator)
    row, cells = usual[0]
    head = _without_tail(heads[-1])
    is_prose = separator == " " and is_comment(lines[number], separator) and abs(len(head) - width) > 1
    return _Mismatch(head, row, _difference(head, _without_tail(cells), number + 1, separator), is_prose)


def _difference(head: Sequence[str], cells: Sequence[str], row: int, separator: str) -> str:
    """How a header in this row of the file and the cells below it differ, in words."""
    if len(head) >= len(cells) and "" in head[1:]:
        return f"column {head.index('', 1) + 1} of {len(cells)} has no name in the header in row {row}"
    counts = f"{len(cells)} cells, and the header in row {row} has {len(head)}"
    return f"{counts}; {DECIMAL_COMMAS}" if separator == "," and len(cells) == 2 * len(head) > 2 else counts


def _fits(head: Sequence[str], width: int, rows: Sequence[Sequence[str]]) -> bool:
    """True if each cell has a name, but for those of the first column and for empty ones."""
    names = _without_tail(head)
    unnamed = [i for i in range(1, width) if i >= len(names) or not names[i]]
    return len(names) <= width and not any(row[i] for row in rows for i in unnamed)


def _rows_below(lines: Sequence[str], number: int, separator: str) -> list[tuple[int, list[str]]]:
    """The first rows below a line, each with its place and its cells."""
    rows = ((n, lines[n]) for n in range(number + 1, len(lines)))
    held = [(n, _cells(line, separator)) for n, line in rows if _holds_row(line, separator)][:ROWS_LOOKED_AT]
    return [(n, cells) for n, cells in held if any(map(is_number, cells))] or held


def _holds_row(line: str, separator: str) -> bool:
    return bool(line.strip(BLANKS)) and not is_comment(line, separator)


def _width(rows: Sequence[tuple[int, list[str]]]) -> int:
    """The number of cells that most rows have."""
    return Counter(len(cells) for _, cells in rows).most_common(1)[0][0]


def _is_of_units(cells: Sequence[str]) -> bool:
    """True if a line has units in place of names or numbers."""
    return any(cells) and all(re.fullmatch(UNITS, cell.lower()) for cell in cells if cell)


def _cells(line: str, separator: str) -> list[str]:
    return [cell.strip(QUOTES) for cell in split(line, separator)]


def _names(line: str, separator: str) -> list[str]:
    """The names in a header, without a mark of a comment before them.

    A mark that stands alone before a blank is no cell. Before another separator it is one, and names a column of numbers.
    """
    written = split(line, separator)
    if not written:
        return []
    first, *others = (cell.strip(QUOTES + "#") for cell in written)
    if is_comment(line, separator):
        first = MARK.sub("", written[0].strip(QUOTES)).strip(QUOTES + "#")
        if not first and separator in " \t":
            return others
    return [first, *others]


def _with_units(names: Sequence[str], separator: str) -> list[list[str]]:
    """The names of a header whose units stand behind blanks, ``A_X [mg] G_X [dps]``, where blanks separate the cells too."""
    joined: list[str] = []
    for name in names if separator == " " else ():
        if joined and BRACKETED.fullmatch(name):
            joined[-1] += f" {name}"
        else:
            joined.append(name)
    return [joined] if 0 < len(joined) < len(names) else []


def _grouped(lines: Sequence[str], number: int, separator: str) -> list[list[str]]:
    """The columns' names in a line, each behind what the line above says of it, if that line heads groups of columns.

    ``Gyroscope,,,Angle`` above ``X,Y,Z,deg`` gives ``Gyroscope X``, ``Gyroscope Y``, ``Gyroscope Z`` and ``Angle (deg)``.
    """
    own = _without_tail(_names(lines[number], separator))
    before = next((line for line in reversed(lines[:number]) if line.strip(BLANKS)), "")
    above = _without_tail(_names(before, separator))
    single = len(set(own)) == len(own) and not _is_of_units(own)
    if single or not 2 <= len(above) <= len(own) or any(map(is_number, above)) or (all(above) and len(above) < len(own)):
        return []
    if _is_of_units(own) and (len(above) < len(own) or any(unit and not name for name, unit in zip(above, own, strict=True))):
        return []
    names, group = [], ""
    for i, cell in enumerate(own):
        alone = i < len(above) and above[i] != ""
        group = above[i] if alone else group
        unit = alone and re.fullmatch(UNITS, cell.lower()) is not None
        names.append(f"{group} ({cell})" if unit else f"{group} {cell}".strip())
    return [names]


def _without_tail(cells: Sequence[str]) -> list[str]:
    """The cells without empty ones at the end: some programs end each line with a separator."""
    kept = list(cells)
    while kept and not kept[-1]:
        kept.pop()
    return kept


def _window(lines: Sequence[str], skip: int | None) -> list[tuple[int, str]]:
    first, last = (0, HEADER_SEARCH_LINES) if skip is None else (skip, skip + 1)
    return list(enumerate(lines))[first:last]


def _shown(lines: Sequence[str], skip: int | None) -> str:
    first = skip or 0
    return f"row {first + 1} is {(lines[first : first + 1] or ['nothing'])[0][:120]!r}"
