"""Files and folders that are written as a whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gyrocal.errors import InputError, first_line

UNREADABLE = (OSError, ValueError, OverflowError, RecursionError)
"""What reading and parsing a text file raises; the errors of tomllib and json are ValueErrors."""
LONGEST_LINE = 1 << 16
"""The bytes of a line that is surely no row of a table."""
LARGEST_TOML_BYTES, LARGEST_JSON_BYTES = 2 << 20, 32 << 20
"""The most bytes of a file that are parsed; either takes about a second."""


def why_unreadable(error: BaseException) -> str:
    """The reason in one line."""
    return "it is nested too deeply" if isinstance(error, RecursionError) else first_line(error)


@contextmanager
def replacing(path: Path, durable: bool = True) -> Iterator[Path]:
    """Yield a new file in the same folder. It replaces ``path`` if the block succeeds, and is deleted if the block fails.

    ``durable`` waits until the data are on the disk; a recording cannot wait for that. A device such as ``/dev/stdout`` is
    written to, and not replaced.
    """
    if path.exists() and not path.is_file():
        yield path
        return
    handle, name = tempfile.mkstemp(dir=path.absolute().parent, prefix=f".{path.name}.", suffix=path.suffix)
    partial = Path(name)
    try:
        os.fchmod(handle, path.stat().st_mode & 0o777 if path.exists() else _allowed(0o666))
        os.close(handle)
        yield partial
        if durable:
            with partial.open("rb+") as written:
                os.fsync(written.fileno())
        os.replace(partial, path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise


def replace_text(path: Path, text: str, check: Callable[[Path], None] = lambda _: None, durable: bool = True) -> None:
    """Replace a file by a text. ``check`` reads the new file before it replaces the old one, and raises if it is wrong."""
    with replacing(path, durable) as partial:
        partial.write_text(text, encoding="utf-8")
        check(partial)


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """Yield a new folder beside ``path``. It is renamed to ``path`` if the block succeeds, and deleted if the block fails."""
    path.absolute().parent.mkdir(parents=True, exist_ok=True)
    partial = Path(tempfile.mkdtemp(dir=path.absolute().parent, prefix=f".{path.name}."))
    try:
        partial.chmod(_allowed(0o777))
        yield partial
        partial.rename(path)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise


def _allowed(mode: int) -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mode & ~mask


def long_line(data: bytes, end: int | None = None) -> int | None:
    """The number, from 1, of a line of more than twice ``LONGEST_LINE`` bytes in ``data[:end]``; some shorter ones count."""
    for start in range(0, (len(data) if end is None else end) - LONGEST_LINE, LONGEST_LINE):
        if data.find(b"\n", start, start + LONGEST_LINE) < 0:
            return data.count(b"\n", 0, start) + 1
    return None


def check_not_endless(path: Path) -> None:
    """Raise InputError for a pipe or a device, from which reading may never end."""
    if path.exists() and not path.is_file() and not path.is_dir():
        raise InputError(f"{path}: a pipe or a device, and not a file; save what it gives in a file")


def read_small_text(path: Path, largest_bytes: int) -> str:
    """The text of a file. Raises InputError if it is a pipe, a device or larger, and else one of ``UNREADABLE``."""
    check_not_endless(path)
    size = path.stat().st_size
    if size > largest_bytes:
        raise InputError(f"{path}: {size} bytes, and at most {largest_bytes} are read; is it the right file?")
    return path.read_text(encoding="utf-8")


def read_toml(path: Path, missing: str, expected: str) -> dict[str, Any]:
    """A TOML file as a dictionary.

    Raises InputError if it cannot be read; ``missing`` is said of an absent file, ``expected`` of one that is no TOML.
    """
    try:
        return tomllib.loads(read_small_text(path, LARGEST_TOML_BYTES))
    except FileNotFoundError:
        raise InputError(f"{path}: {missing}") from None
    except UNREADABLE as error:
        expectation = f"not {expected}: " if isinstance(error, ValueError) else ""
        raise InputError(f"{path}: {expectation}{why_unreadable(error)}") from None
