"""Which name belongs to which cell: a table is read as its header says, or refused; a column never shifts."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gyrocal.cli import main
from gyrocal.errors import InputError
from gyrocal.recording import readers
from gyrocal.recording.column_map import Scaling
from gyrocal.recording.guess import guess
from gyrocal.recording.import_options import Options
from gyrocal.recording.importer import read_recording
from gyrocal.recording.session import Session
from gyrocal.recording.table import read_table

NAMES = ["time", "gx", "gy", "gz", "temp"]
N = 60
MARKS = ["", "#", "# ", "##", "#\t", ";", "; ", "%", "% ", "//", "// ", " # "]
SEPARATORS = [",", ";", "\t", " ", "|"]
UNITS = ["s", "dps", "dps", "dps", "degC"]
OFF = {name: 10_000 * k for k, name in enumerate(NAMES)}
"""The values of each column lie between this and 10 000 more, so that a value tells its column."""


def cells(rows: int = N) -> list[list[str]]:
    return [[f"{OFF[name] + 0.25 * i + 0.125:.3f}" for name in NAMES] for i in range(rows)]


def text(head: list[str], rows: list[list[str]], separator: str, mark: str = "", tail: str = "\n") -> str:
    return tail.join([mark + separator.join(head), *(separator.join(row) for row in rows)]) + tail


def write(tmp_path: Path, content: str) -> Path:
    (tmp_path / "log.txt").write_text(content, encoding="utf-8")
    return tmp_path / "log.txt"


def wrong(frame: pl.DataFrame) -> list[str]:
    """The columns with one of the names that hold another one's values."""
    found = []
    for name in frame.columns:
        plain = name.partition(" (")[0]
        values = frame[name].cast(pl.Float64, strict=False).drop_nulls().to_numpy()
        off = OFF.get(plain)
        if off is None or np.any((values < off) | (values >= off + 10_000)):
            found.append(name)
    return found


def read(path: Path, names: list[str]) -> pl.DataFrame:
    frame = readers.read(path, names).frame
    assert wrong(frame) == []
    return frame


def check_whole(path: Path, names: list[str]) -> None:
    """Every row of every column is there."""
    frame = read(path, names)
    for k, name in enumerate(NAMES):
        column = next(c for c in frame.columns if c.partition(" (")[0] == name)
        values = frame[column].cast(pl.Float64, strict=False).drop_nulls().to_list()
        assert values == [float(row[k]) for row in cells()]


@pytest.mark.parametrize("names", [[], NAMES], ids=["guessed", "named"])
@pytest.mark.parametrize("separator", SEPARATORS)
@pytest.mark.parametrize("mark", MARKS)
def test_a_mark_before_the_header_is_no_column(tmp_path: Path, mark: str, separator: str, names: list[str]) -> None:
    path = write(tmp_path, text(NAMES, cells(), separator, mark))
    if separator == ";" == mark[:1]:  # an empty cell, as that of an index, which these rows do not have
        with pytest.raises(InputError, match="row 2: 5 cells, and the header in row 1 has 6"):
            readers.read(path, NAMES)
    else:
        check_whole(path, names)


DECORATED = {
    "byte order mark and mark": "\ufeff" + text(NAMES, cells(), " ", "# "),
    "several spaces": text(NAMES, cells(), "    ", "#  "),
    "a mark before a tab, tabs and blanks": text(NAMES, cells(), "  ", "#\t").replace("  gz", "\tgz"),
    "columns of fixed width": "".join("".join(f"{c:>14}" for c in row) + "\n" for row in [["# time", *NAMES[1:]], *cells()]),
    "quotes about names and mark": text(['"# time"', *(f'"{n}"' for n in NAMES[1:])], cells(), ","),
    "a comment above and one below": "# logger 3 of 5\n# time gx gy gz temp\n# 100 Hz\n" + text([], cells(), " ").lstrip(),
    "units below": text(NAMES, [UNITS, *cells()], ","),
    "units below in a comment": text(NAMES, [["# s", *UNITS[1:]], *cells()], " ", "# "),
    "comments between rows": text(NAMES, [*cells()[:5], ["# 1 2 3 4 5"], ["// stopped"], ["% 7"], *cells()[5:]], " "),
    "an index without a name": text(["", *NAMES], [[str(i), *row] for i, row in enumerate(cells())], ","),
    "an index without a name by tabs": text(["", *NAMES], [[str(i), *row] for i, row in enumerate(cells())], "\t"),
    "an index without a name by semicolons": text(["", *NAMES], [[str(i), *row] for i, row in enumerate(cells())], ";"),
    "a number sign as the name of the index": text(["#", *NAMES], [[str(i), *row] for i, row in enumerate(cells())], ","),
    "a separator at the end of all rows": text(NAMES, [[*row, ""] for row in cells()], ","),
    "a separator at the end of the header": text([*NAMES, ""], cells(), ";", "% "),
    "separators at the end of all lines": text([*NAMES, "", ""], [[*row, "", ""] for row in cells()], ","),
    "lines of Windows": text(NAMES, cells(), " ", "# ", "\r\n"),
}  # fmt: skip


@pytest.mark.parametrize("names", [[], NAMES], ids=["guessed", "named"])
@pytest.mark.parametrize("kind", DECORATED)
def test_a_decorated_header_names_its_own_columns(tmp_path: Path, kind: str, names: list[str]) -> None:
    check_whole(write(tmp_path, DECORATED[kind]), names)


DIFFERING = {
    "a name too few": (text(NAMES[:-1], cells(), ","), "row 2: 5 cells, and the header in row 1 has 4"),
    "a name too few behind a mark": (text(NAMES[:-1], cells(), " ", "# "), "row 2: 5 cells, and the header in row 1 has 4"),
    "a name too many": (text([*NAMES, "flag"], cells(), ";"), "row 2: 5 cells, and the header in row 1 has 6"),
    "an index without any cell for it": (
        text(NAMES, [[str(i), *row] for i, row in enumerate(cells())], "\t"), "row 2: 6 cells, and the header in row 1 has 5",
    ),
    "empty cells between tabs": (
        text(NAMES[:-1], [[row[0], "", *row[2:]] for row in cells()], "\t"), "row 2: 5 cells, and the header in row 1 has 4",
    ),
    "no name between others": (text(["time", "gx", "", "gz", "temp"], cells(), ","), "row 2: column 3 of 5 has no name"),
    "many rows that are short": (
        text(NAMES, [row if i % 7 else row[:-1] for i, row in enumerate(cells(), 1)], ","),
        "row 8: 4 cells, and the table has 5 in a row; 8 of 60 rows are so",
    ),
    "a separator at the end of some rows": (
        text(NAMES, [row if i % 7 else [*row, ""] for i, row in enumerate(cells(), 1)], ","), "row 8: 6 cells",
    ),
}  # fmt: skip


@pytest.mark.parametrize("names", [[], ["time", "gx"]], ids=["guessed", "named"])
@pytest.mark.parametrize("kind", DIFFERING)
def test_rows_and_headers_that_differ_are_refused_with_both_counts(tmp_path: Path, kind: str, names: list[str]) -> None:
    content, says = DIFFERING[kind]
    path = write(tmp_path, content)
    with pytest.raises(InputError) as told:
        readers.read(path, names)
    assert f"{path}: {says}" in str(told.value)
    assert "\n" not in str(told.value)
    assert "--columns a,b,c" in str(told.value)


def test_columns_that_are_stated_read_what_the_header_does_not_name(tmp_path: Path) -> None:
    path = write(tmp_path, DIFFERING["a name too few"][0])
    assert wrong(readers.read(path, columns=NAMES).frame) == []
    with pytest.raises(InputError, match=r"no row of 4 cells with numbers in time, .*; most rows have 5 cells: name as many"):
        readers.read(path, columns=NAMES[:-1])


@pytest.mark.parametrize("separator", [",", ";", "\t", " "])
def test_stated_columns_may_hold_words(tmp_path: Path, separator: str) -> None:
    """The kind of a row, or a date in a column of its own."""
    for word in ("GYRO", "2024-05-01"):
        path = write(tmp_path, "\n".join(separator.join([word, *row]) for row in cells()))
        frame = readers.read(path, columns=["word", *NAMES]).frame
        assert wrong(frame.drop("word")) == []
        assert frame.height == N


def test_rows_of_two_sensors_are_told_by_their_words(tmp_path: Path) -> None:
    """The accelerations between the rates would be read as rates."""
    path = write(tmp_path, "\n".join(f"{kind} {10 * i} 0.1 0.2 {0.3 + i % 3}" for i in range(N) for kind in ("acc", "gyro")))
    source = readers.read(path, columns=["what", "time", "gx", "gy", "gz"])
    with pytest.raises(InputError, match=r"what says that the rows are of several sensors \(acc, gyro\); keep those of one"):
        guess(source, Scaling())


@pytest.mark.parametrize("what", ["kind", "sensor_id"])
def test_rows_of_two_sensors_are_refused_with_stated_columns_too(what: str, tmp_path: Path) -> None:
    """Every mapping is given, and a column that is not mapped says it: by words in its cells, or by its name."""
    kinds = {"kind": ("acc", "gyro"), "sensor_id": ("0", "1")}[what]
    maps = ["t_s=time:ms", "gx_dps=gx", "gy_dps=gy", "gz_dps=gz"]
    names = [what, *NAMES[:4]]
    rows = [f"{kind} {10 * i} 0.1 0.2 {0.3 + i % 3}" for i in range(N) for kind in kinds]
    at_rest = {"table_rate_dps": 0.0}
    for head, columns in (("", names), (" ".join(names) + "\n", None)):
        path = write(tmp_path, head + "\n".join(rows))
        with pytest.raises(InputError, match=rf"{what} says that the rows are of several sensors \({kinds[0]}, {kinds[1]}\)"):
            read_recording(path, Options(maps, columns=columns, defaults=at_rest))
    one = write(tmp_path, " ".join(names) + "\n" + "\n".join(rows[::2]))
    assert len(read_recording(one, Options(maps, defaults=at_rest)).session.runs[0]) == N


@pytest.mark.parametrize("separator", [",", ";", "\t", " "])
@pytest.mark.parametrize("blank", ["", " ", "  ", "\t"])
def test_lines_of_blanks_between_the_rows_are_no_rows(tmp_path: Path, separator: str, blank: str) -> None:
    path = write(tmp_path, text(NAMES, cells(), separator, tail=f"\n{blank}\n"))
    maps = ["t_s=time", *(f"{name}_dps={name}" for name in NAMES[1:4])]
    found = read_recording(path, Options(maps, defaults={"table_rate_dps": 0.0}))
    assert sum(len(run) for run in found.session.runs) == N


def test_a_row_that_lacks_an_optional_cell_is_left_out_and_counted(tmp_path: Path) -> None:
    """Nobody knows which of its cells is the one that is missing."""
    rows = cells()
    del rows[30][2]
    path = write(tmp_path, text(NAMES, rows, ","))
    maps = ["t_s=time:ms", *(f"g{a}_dps=g{a}*0.001" for a in "xyz"), "temp_c=temp"]
    found = read_recording(path, Options(maps, defaults={"table_rate_dps": 0.0}))
    assert found.repaired == {"rows": 1}
    assert "row 32: time is 'in a row of more or fewer cells'" in found.warnings[0].text
    assert len(found.session.runs[0]) == N - 1


def test_a_header_behind_a_mark_makes_the_session_that_it_makes_without(tmp_path: Path) -> None:
    """Shifted by one column, the accelerometer's x was taken for the gyroscope's z, and nothing was said."""
    names = ["time", "tx", "ty", "tz", "ax", "ay", "az"]
    rows = [[f"{i / 100:.2f}", "0.1", "0.2", f"{78 + i % 3}", "0.5", "0.6", "9.81"] for i in range(N)]
    maps = [w for m in ("t_s=time", "gx_dps=tx", "gy_dps=ty", "gz_dps=tz", "ax_g=ax:m/s2") for w in ("--map", m)]
    runs = []
    for name, mark in (("plain", ""), ("marked", "# ")):
        path = write(tmp_path, text(names, rows, " ", mark))
        assert main(["import", str(path), str(tmp_path / name), *maps, "--rate", "78"]) == 0
        runs.append(Session.open(tmp_path / name).runs[0].table)
    assert runs[1].equals(runs[0])


@st.composite
def tables(draw: st.DrawFn) -> str:
    """A table with any of the decorations, and sometimes with a fault."""
    separator = draw(st.sampled_from(SEPARATORS))
    head, rows, units = list(NAMES), cells(24), list(UNITS)
    if draw(st.booleans()):  # an index, with or without a cell for it in the header
        rows = [[str(i), *row] for i, row in enumerate(rows)]
        index = {" ": ["i"], "\t": ["", "i"]}.get(separator, ["", "i", "#"])  # before a blank a number sign is a mark
        head = [*draw(st.sampled_from([[], *([name] for name in index)])), *head]
        units = ["", *units]
    faults = ["", "", "name", "no name", "cell", "cells", "short", "long"]
    fault = draw(st.sampled_from([*faults, "names"] if len(head) == len(rows[0]) else faults))
    place = draw(st.integers(0, 4))
    match fault:
        case "name":
            del head[place]
        case "names":
            head.insert(place, "flag")
        case "no name":
            head[place] = ""
        case "cell":
            del rows[draw(st.integers(0, 23))][place]
        case "cells":
            rows[draw(st.integers(0, 23))].insert(place, "7")
        case "short":
            # with an index that has no name, rows that all lack their last cell are whole rows of the header's columns
            least = 1 if len(head) == len(rows[0]) else 2
            rows = [row[:-1] if i % draw(st.integers(least, 3)) == 0 else row for i, row in enumerate(rows)]
        case "long":
            rows = [[*row, "7"] for row in rows]
    if draw(st.booleans()) and fault != "names":  # which would give the last name an empty column
        rows = [[*row, ""] for row in rows]
    if draw(st.booleans()):
        head = [*head, ""]
    marks = [""] if separator == "\t" and not head[0] else [mark for mark in MARKS if mark[:1] != separator]
    if draw(st.booleans()):
        head = [f'"{name}"' for name in head]
    if draw(st.booleans()):
        rows = [[cell.replace(".", ",") for cell in row] for row in rows]
    pad = draw(st.sampled_from(["", " ", "   "]))
    lines = [draw(st.sampled_from(marks)) + (separator + pad).join(head)]
    if draw(st.booleans()):
        lines.append(draw(st.sampled_from(["", "# "])) + separator.join(units))
    lines += [(pad + separator).join(row) for row in rows]
    comments = ["# a note", "% 1 2 3", "// 5,6", "; 7", "", "#1;2;3;4;5", "--- begun again 3", "#,1,2,3,4", "resumed"]
    for comment in draw(st.lists(st.sampled_from(comments), max_size=3)):
        lines.insert(draw(st.integers(0, len(lines))), comment)
    return draw(st.sampled_from(["", "\ufeff"])) + draw(st.sampled_from(["\n", "\r\n"])).join(lines) + "\n"


@settings(max_examples=300, deadline=None)
@given(content=tables(), names=st.sampled_from([[], ["time", "gx"], ["gz"], NAMES]))
def test_a_table_is_read_with_its_columns_in_place_or_refused(
    tmp_path_factory: pytest.TempPathFactory, content: str, names: list[str]
) -> None:
    path = write(tmp_path_factory.getbasetemp(), content)
    try:
        frame = readers.read(path, names).frame
    except InputError:
        return
    wanted = names or [name for name in frame.columns if name.partition(" (")[0] in NAMES]
    assert wrong(frame.select(wanted)) == [], content


ROWS = "# time gx gy gz\n" + "".join(f"{i / 100} 0.5 {i % 3} 7{i % 10}\n" for i in range(N))
STATED = ["--map", "t_s=time:s", "--map", "gz_dps=gz"]


@pytest.mark.parametrize("words", [["--yes"], STATED], ids=["guessed", "stated"])
def test_the_first_rows_are_shown_as_they_are_read(
    tmp_path: Path, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path, ROWS)
    (tmp_path / "ref.csv").write_text("t,table_rate_dps\n" + "".join(f"{i / 100},7{i % 10}\n" for i in range(N)))
    command = ["import", str(path), str(tmp_path / "out"), *words, "--reference", str(tmp_path / "ref.csv"), "--yes"]
    assert main(command) == 0
    said = [" ".join(line.replace("│", " ").split()) for line in capsys.readouterr().out.splitlines()]
    assert any(line.startswith("t_s=time:s 0 0.01 0.02") for line in said)
    assert any(line.startswith("gz_dps=gz") and "70 71 72" in line for line in said)
    assert any(line.startswith("rate_ref_dps=table_rate_dps:dps 70 71 72") for line in said)
    assert any("as stated" in line for line in said) == (words == STATED)
    assert main([*command[:2], str(tmp_path / "new"), *command[3:], "--json"]) == 0
    told = {each["target"]: each for each in json.loads(capsys.readouterr().out)["first_rows"]}
    assert (told["gz_dps"]["column"], told["gz_dps"]["values"]) == ("gz", ["70", "71", "72"])
    assert told["rate_ref_dps"]["file"] == str(tmp_path / "ref.csv")
    assert told["t_s"]["unit"] == "s"


def test_a_row_of_a_session_that_differs_from_its_header_says_what_to_do(tmp_path: Path) -> None:
    for more, row in (("", "0,1,2,3,4"), (",temp_c", "0,1,2,3")):
        (tmp_path / "a.csv").write_text("\n".join([f"t_s,gx_dps,gy_dps,gz_dps{more}", *3 * [row], ""]))
        with pytest.raises(InputError, match=r"a.csv: row 2: \d cells, the header has \d; correct the row, delete"):
            read_table(tmp_path / "a.csv")


def test_a_file_of_a_folder_that_is_taken_otherwise_is_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each file is guessed on its own: one in rad/s among others in deg/s is seen."""
    (tmp_path / "in").mkdir()
    for name, unit in (("a_down", "dps"), ("b_up", "dps"), ("c_up", "rad/s")):
        head = ",".join(["time (s)", *(f"g{axis} ({unit})" for axis in "xyz")])
        rows = "".join(f"{i / 100},0.5,{i % 3},1.36{i % 10}\n" for i in range(N))
        (tmp_path / "in" / f"{name}.csv").write_text(f"{head}\n{rows}")
    assert main(["import", str(tmp_path / "in"), str(tmp_path / "out"), "--rate", "78", "--yes"]) == 0
    said = [" ".join(line.replace("│", " ").split()) for line in capsys.readouterr().out.splitlines()]
    shown = [line for line in said if line.startswith("gz_dps=gz")]
    assert len(shown) == 2
    assert shown[0].endswith("a_down.csv: the unit is in its name")
    assert shown[1].endswith("c_up.csv: the unit is in its name")
