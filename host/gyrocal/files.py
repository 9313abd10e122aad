"""Files and folders that come whole or not at all, beside what is there already."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(path: Path, durable: bool = True) -> Iterator[Path]:
    """A new file in the same folder that takes the name of ``path`` once the block ends well, and goes if it does not.

    ``durable`` waits until the disk has it, which a recording cannot.
    """
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
    """Write a text; ``check`` reads it back before it takes the place of what was there, and raises where it is wrong."""
    with replacing(path, durable) as partial:
        partial.write_text(text, encoding="utf-8")
        check(partial)


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """A folder beside ``path`` that takes its name once the block ends well, and goes if it does not."""
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
