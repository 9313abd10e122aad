"""The table of a run, CSV or Parquet: its columns, read, checked and written.

Bad input raises :class:`~gyrocal.errors.InputError` with one line that names the file, the row (the header is row 1) and the
reason.
"""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from gyrocal.errors import InputError, first_line
from gyrocal.files import LONGEST_LINE, long_line
from gyrocal.recording.parquet_pages import read_parquet
from gyrocal.recording.stamps import step_range_s
from gyrocal.units import CELSIUS

Array = np.ndarray[Any, np.dtype[np.float64]]
REQUIRED = ("t_s", "gx_dps", "gy_dps", "gz_dps")
OPTIONAL = (
    "ax_g", "ay_g", "az_g", "temp_c", "rate_ref_dps", "table_angle_deg", "ref_angle_deg", "ref_x_dps", "ref_y_dps", "ref_z_dps",
    "ref_qw", "ref_qx", "ref_qy", "ref_qz",
)  # fmt: skip
UNITS = {"dps": "dps", "g": "g", "c": CELSIUS, "deg": "degrees"}
"""The unit at the end of a column's name."""
NUMBERS = b"0123456789+-.eE, \t\r\n" + b"nafiNAFI"
"""Characters of a table's rows. The values nan and inf are read, and then rejected with their row."""
UNEVEN = "correct the row, delete it, or import the recording again"
SMALL_BYTES = 2**18
"""A shorter table is parsed faster here than by the reader for large ones, which distributes it over threads."""
LARGEST_DPS = 1e6
"""No gyroscope reads more; a larger value is one of another unit."""


def read_table(path: Path, name: str | None = None) -> pl.DataFrame:
    """Read and check a run's table (CSV or Parquet), float64 columns, missing optional cells null."""
    return read_table_and_damage(path, name)[0]


def read_table_and_damage(path: Path, name: str | None = None) -> tuple[pl.DataFrame, str]:
    """:func:`read_table`, and what was left out of it: a last row that was not written to its end."""
    label = str(path) if name is None or path.name == Path(name).name else name
    if path.suffix == ".parquet":
        try:
            return check_table(read_parquet(path), label), ""
        except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
            raise InputError(f"{label}: not a readable Parquet file: {first_line(error)}") from None
    try:
        content = path.read_bytes()
        if not content.strip():
            raise InputError(f"{label}: the file is empty; record the run again")
        first, _, body = content.partition(b"\n")
        if row := long_line(content):
            raise InputError(f"{label}: row {row}: more than {LONGEST_LINE} bytes in one line; is the file a table?")
        header = [name.strip() for name in first.decode("utf-8-sig").strip().split(",")]
    except UnicodeDecodeError:
        raise InputError(f"{label}: row 1: not text in UTF-8; save the table as CSV in UTF-8") from None
    except OSError as error:
        raise InputError(f"{label}: {first_line(error)}") from None
    _check_columns(header, label)
    body, damage = _without_unfinished(body, len(header))
    if body.translate(None, NUMBERS):  # anything but numbers: name the row, before the fast reader meets it
        _find_bad_row(path, label, len(header))
    if not body.strip():
        raise InputError(f"{label}: row 2: no samples")
    if len(body) < SMALL_BYTES and (numbers := _numbers(body, len(header))) is not None:
        return check_table(pl.DataFrame(numbers, schema=header), label), damage
    try:
        table = pl.read_csv(body, has_header=False, new_columns=header, schema_overrides=[pl.Float64] * len(header))
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        _find_bad_row(path, label, len(header))
        raise InputError(f"{label}: {first_line(error)}") from None
    if table[header[-1]].null_count():
        _find_bad_row(path, label, len(header))
    return check_table(table, label), damage


def write_table(table: pl.DataFrame, path: Path) -> None:
    """Write a run's table as Parquet or CSV, which ``.gz`` compresses, by the name's ending; times to the microsecond."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".parquet":
        table.write_parquet(path)
        return
    shown = table.with_columns(pl.col(c).round(6 if c == "t_s" else 9) for c in table.columns)
    if path.suffix == ".gz":
        path.write_bytes(gzip.compress(shown.write_csv().encode(), mtime=0))
    else:
        shown.write_csv(path)


def all_finite(values: Array) -> bool:
    """True if every value of an array [n] is finite. A finite sum has no other terms, and is computed at once."""
    with np.errstate(invalid="ignore", over="ignore"):
        return bool(np.isfinite(values.sum())) or bool(np.isfinite(values).all())


def check_table(table: pl.DataFrame, label: str) -> pl.DataFrame:
    """The known columns of a table as float64, checked for finite values and time that runs forward."""
    _check_columns(table.columns, label)
    known = [c for c in (*REQUIRED, *OPTIONAL) if c in table.columns]
    if known != table.columns or any(kind != pl.Float64 for kind in table.dtypes):
        try:
            table = table.select(pl.col(known).cast(pl.Float64))
        except pl.exceptions.PolarsError as error:
            raise InputError(f"{label}: {first_line(error)}") from None
    if table.height < 2:
        raise InputError(f"{label}: row {table.height + 1}: a run needs two samples at least")
    for name in known:
        column = table[name]
        if all_finite(column.to_numpy()):  # an empty cell is NaN here
            continue
        bad = column.is_null() if name in REQUIRED else pl.repeat(False, table.height, eager=True)
        bad = bad | (column.is_finite() == False).fill_null(False)  # noqa: E712
        if bad.any():
            row = int(bad.arg_true()[0])
            value = column[row]
            raise InputError(f"{label}: row {row + 2}: {name} is {'empty' if value is None else value}, not a finite number")
    largest = max(abs(float(end)) for name in REQUIRED[1:] for end in (table[name].min(), table[name].max()))  # type: ignore[arg-type]
    if largest > LARGEST_DPS:
        raise InputError(f"{label}: a rate of {largest:.3g} dps is none a gyroscope reads; check the unit")
    t_s = table["t_s"].to_numpy()
    surely_forward = step_range_s(t_s)[0] > 2e-6
    if not surely_forward and (back := np.flatnonzero(np.diff(np.rint(t_s * 1e6)) <= 0)).size:
        row = int(back[0]) + 1
        word = "repeats" if t_s[row] == t_s[row - 1] else "goes back or moves by less than 1 us"
        raise InputError(f"{label}: row {row + 2}: t_s {word} ({t_s[row - 1]:.9g} then {t_s[row]:.9g})")
    return table.rechunk()


def _check_columns(columns: list[str], label: str) -> None:
    doubled = {c for c in columns if columns.count(c) > 1}
    if doubled:
        raise InputError(f"{label}: row 1: column {sorted(doubled)[0]!r} stands twice in the header")
    missing = [c for c in REQUIRED if c not in columns]
    if missing:
        comma = "; cells are separated by commas here: `gyrocal import` reads other tables" if len(columns) == 1 else ""
        raise InputError(f"{label}: row 1: the header lacks {', '.join(missing)}; it has {', '.join(columns)[:120]}{comma}")

    for name in OPTIONAL:
        stem, _, unit = name.rpartition("_")
        if unit not in UNITS:  # a quaternion has none
            continue
        other = next((c for c in columns if c == stem or c.startswith(f"{stem}_")), None)
        if name not in columns and other is not None:
            raise InputError(
                f"{label}: row 1: {other} would not be read; what is read is {name}, in {UNITS[unit]}: convert it, or drop it"
            )


def _without_unfinished(body: bytes, width: int) -> tuple[bytes, str]:
    """The rows of a table without a last one that was cut off, and what to say of it.

    A last row without a line's end may have lost digits: it is left out where its last cell is far from those above.
    """
    rows = body.rsplit(b"\n", 101)
    ended = rows[-1].strip() == b""
    if ended:
        rows.pop()
    if len(rows) < 3:
        return body, ""
    cells = rows[-1].split(b",")
    short = len(cells) < width and b"".join(cells).strip() != b""
    if not short and (ended or (_is_number_at(cells[-1]) and not _cut(cells[-1], rows[1:-1]))):
        return body, ""
    kept = body.rstrip()[: -len(rows[-1].rstrip())] if rows[-1].strip() else body
    what = f"{len(cells)} cells of {width}" if short else f"it ends with {cells[-1].decode(errors='replace')!r}"
    return kept, f"the last row was not written to its end ({what}) and is left out; nothing needs to be changed"


def _numbers(body: bytes, width: int) -> Array | None:
    """The cells of a table [rows, width]; None unless every row has its width and every cell a number."""
    text = body.rstrip(b"\r\n") + b"\n"
    letters = np.frombuffer(text, dtype=np.uint8)
    ends = letters[(letters == ord(",")) | (letters == ord("\n"))]
    if ends.size % width or (ends.reshape(-1, width) != np.frombuffer(b"," * (width - 1) + b"\n", dtype=np.uint8)).any():
        return None
    try:
        return np.array(text[:-1].replace(b"\n", b",").split(b","), dtype=np.float64).reshape(-1, width)
    except ValueError:
        return None


def _is_number_at(cell: bytes) -> bool:
    return _is_number(cell.decode(errors="replace"))


def _cut(cell: bytes, rows: list[bytes]) -> bool:
    """True if a last cell is far from the last cells of the rows above, as a number that lost its end is."""
    above = [c for c in (row.rsplit(b",", 1)[-1].strip() for row in rows) if c and _is_number_at(c)]
    if not above:
        return False
    if not cell.strip():
        return len(above) == len(rows)
    values = [float(c) for c in above]
    low, high = min(values), max(values)
    return not low - (high - low) <= float(cell) <= high + (high - low)


def _find_bad_row(path: Path, label: str, width: int) -> None:
    """Raise InputError for the first row that is short, long or not a number; return if there is none."""
    with path.open("r", encoding="utf-8", errors="replace") as handle:
        next(handle)
        for number, line in enumerate(handle, start=2):
            if not line.strip():
                raise InputError(f"{label}: row {number}: empty row")
            cells = line.rstrip("\r\n").split(",")
            if len(cells) != width:
                raise InputError(f"{label}: row {number}: {len(cells)} cells, the header has {width}; {UNEVEN}")
            for cell in cells:
                if not _is_number(cell):
                    raise InputError(f"{label}: row {number}: {cell.strip()!r} is not a number")


def _is_number(cell: str) -> bool:
    """Empty counts; digits of other scripts and 1_000 do not, which Python would read."""
    try:
        return not cell.strip() or (cell.encode().translate(None, NUMBERS) == b"" and isinstance(float(cell), float))
    except ValueError:
        return False
