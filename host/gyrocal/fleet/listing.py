"""The sessions of a fleet: a folder of session folders, or a list of their paths, here or on object storage (fsspec)."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import polars as pl

from gyrocal.errors import InputError, first_line
from gyrocal.files import UNREADABLE, why_unreadable
from gyrocal.recording.parquet_pages import read_parquet

HEADER = "session.toml"
LISTS = (".json", ".parquet")


def sessions(source: str) -> list[str]:
    """The paths of all sessions, sorted, without repetition.

    ``source`` is a folder (every ``session.toml`` below it is one), a JSON list of paths, or a Parquet table with the column
    ``path``. It may be a URL that fsspec knows (``s3://bucket/fleet``). Paths in a list are relative to the list's folder.
    Raises InputError if there is none.
    """
    found = _remote(source) if "://" in source else _local(Path(source))
    if not found:
        raise InputError(f"{source}: no session in it; a fleet is a folder of session folders, or a list of their paths")
    return sorted(set(found))


def _local(source: Path) -> list[str]:
    if source.suffix in LISTS:
        return [str(source.parent / path) if "://" not in path else path for path in _listed(source, str(source))]
    if not source.is_dir():
        raise InputError(f"{source}: no such folder; a fleet is a folder of session folders, or a list of their paths")
    found = (header.parent for header in source.rglob(HEADER))
    return [str(path) for path in found if not path.name.startswith(".")]  # a hidden one is still being written


def _remote(source: str) -> list[str]:
    files, root = _file_system(source)
    protocol = source.split("://")[0]
    if Path(root).suffix in LISTS:
        folder = source.rsplit("/", 1)[0]
        with files.open(root, "rb") as handle:
            return [path if "://" in path else f"{folder}/{path}" for path in _listed(handle, source)]
    return [f"{protocol}://{found.rsplit('/', 1)[0]}" for found in files.glob(f"{root}/**/{HEADER}")]


def _listed(content: Any, name: str) -> list[str]:
    """The paths of a list, which is a path or an open file."""
    try:
        if name.endswith(".parquet"):
            paths = read_parquet(content)["path"].to_list()
        else:
            paths = json.loads(content.read_bytes() if isinstance(content, Path) else content.read())
    except (*UNREADABLE, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        raise InputError(
            f"{name}: {why_unreadable(error)}; give a JSON list of paths, or a Parquet table with a column path"
        ) from None
    if not isinstance(paths, list) or not all(isinstance(path, str) for path in paths):
        raise InputError(f"{name}: not a list of paths")
    return paths


def _file_system(url: str) -> tuple[Any, str]:
    try:
        from fsspec.core import url_to_fs
    except ImportError:
        raise InputError(f"{url}: needs fsspec; pip install 'gyrocal[fleet]'") from None
    try:
        files, root = url_to_fs(url)
    except (ImportError, ValueError) as error:
        raise InputError(f"{url}: {first_line(error)}") from None
    return files, root.rstrip("/")


@contextmanager
def at_hand(path: str) -> Iterator[Path]:
    """A session's folder on this machine. One from object storage is copied and removed afterwards."""
    if "://" not in path:
        yield Path(path)
        return
    files, root = _file_system(path)
    with tempfile.TemporaryDirectory(prefix="gyrocal-") as folder:
        target = Path(folder) / "session"
        files.get(root, str(target), recursive=True)
        yield target
