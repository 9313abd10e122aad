"""One file for each kind of recording by others; it imports what lies in ``recording/`` below it.

:func:`read` chooses by what the file holds, not by its name.
"""

from __future__ import annotations

import gzip
import io
import zlib
from collections.abc import Sequence
from pathlib import Path

from gyrocal.errors import InputError, first_line
from gyrocal.files import check_not_endless
from gyrocal.recording.source import Source

LFS_POINTER = b"version https://git-lfs"
HEAD_BYTES = 1024
"""Bytes of a file's beginning that show its format."""


def read(
    path: Path,
    names: Sequence[str] = (),
    columns: Sequence[str] | None = None,
    skip: int | None = None,
    topic: str | None = None,
    option: str = "--",
) -> Source:
    """The table in a file, or in a folder that is a ROS 2 bag.

    ``names`` are the columns that will be asked for: a text's header is found by them. ``columns`` names all columns of a text
    without a header, ``skip`` is the number of lines above it. ``topic`` names one table of a file that holds several.
    ``option`` is what the options begin with that an error advises, ``--ref-`` for those of the reference's file.
    """
    from gyrocal.recording.readers import arrays, foreign, parquet, rosbag, text, ulog

    if path.is_dir():
        if (path / "metadata.yaml").is_file():
            return rosbag.read(path, topic, option)
        raise InputError(f"{path}: a folder without metadata.yaml, which a ROS 2 bag has; give the file itself")
    try:
        check_not_endless(path)
        with path.open("rb") as handle:
            head = handle.read(HEAD_BYTES)
        if head.startswith(LFS_POINTER):
            raise InputError(f"{path}: a pointer of Git LFS and not the file itself; fetch that by: git lfs pull")
        foreign.refuse(path, head)
        if rosbag.is_bag(head):
            return rosbag.read(path, topic, option)
        if head.startswith(ulog.MAGIC):
            return ulog.read(path, topic, option)
        if head.startswith(arrays.ZIP):
            return arrays.read_npz(path)
        file: Path | io.BytesIO = path
        if head[:2] == b"\x1f\x8b":
            file = io.BytesIO(_unzipped(path))
            head = file.getvalue()[:HEAD_BYTES]
        if head[:4] == parquet.MAGIC:
            return parquet.read(path, file)
        if arrays.is_mat(head):
            return arrays.read_mat(path, file, head)
        data = file.read_bytes() if isinstance(file, Path) else file.getvalue()
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: {getattr(error, 'strerror', None) or first_line(error)}") from None
    return text.read(path, data, names, columns, skip, option)


def _unzipped(path: Path) -> bytes:
    try:
        return gzip.decompress(path.read_bytes())
    except (EOFError, zlib.error, gzip.BadGzipFile):
        damaged = "the compressed file is cut off or damaged; copy it again, or save what gunzip makes of it"
        raise InputError(f"{path}: {damaged}") from None
