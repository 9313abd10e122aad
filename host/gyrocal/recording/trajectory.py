"""Trajectories without a header, as programs of visual odometry write them: TUM's, and KITTI's with the file of their times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from gyrocal.errors import InputError
from gyrocal.recording import readers
from gyrocal.recording.column_map import ColumnMap
from gyrocal.recording.orientation import UNIT_WITHIN
from gyrocal.recording.session import Array
from gyrocal.recording.source import Source

TUM = ("timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw")
"""The columns of a TUM trajectory: the quaternion's real part is the last."""
KITTI = tuple(f"{part}{row}" if part == "t" else f"r{row}{part}" for row in "123" for part in "123t")
"""The columns of KITTI's poses: the rows of a rotation matrix, each with a part of the place."""


def columns_of(path: Path) -> tuple[str, ...] | None:
    """The columns of a text that is a trajectory without a header; None if it is none.

    TUM's rows begin with a time and end with a unit quaternion. InputError for poses of KITTI without their times.
    """
    values = _numbers(path, TUM)
    if values is not None:
        size = np.linalg.norm(values[:, 4:], axis=1)
        forward = bool(np.all(np.diff(values[:, 0]) >= 0) and values[-1, 0] > values[0, 0])
        return TUM if forward and np.all(np.abs(size - 1) < UNIT_WITHIN) else None
    values = _numbers(path, KITTI)
    if values is not None:
        turned = values.reshape(-1, 3, 4)[:, :, :3]
        if np.allclose(turned @ turned.transpose(0, 2, 1), np.eye(3), atol=UNIT_WITHIN):
            if times_of(path) is not None:
                return KITTI
            raise InputError(
                f"{path}: poses of KITTI, which have no times; put times.txt beside them, or write each with its time "
                f"of times.txt as a row of TUM: "
                f"{' '.join(TUM)}"
            )
    return None


def times_of(path: Path) -> Path | None:
    """The file of the times of KITTI's poses: ``times.txt`` beside them, or in the folder of their sequence."""
    places = (path.parent, path.parent / path.stem, path.parent.parent / "sequences" / path.stem)
    return next((place / "times.txt" for place in places if (place / "times.txt").is_file()), None)


def with_times(source: Source, path: Path, names: Sequence[str] | None) -> Source:
    """Poses of KITTI with the column ``timestamp`` of their times, s; any other table as it is.

    InputError where there are not as many times as poses.
    """
    file = times_of(path) if tuple(names or ()) == KITTI else None
    if file is None:
        return source
    times = readers.read(file, columns=["timestamp"]).frame
    if times.height != source.frame.height:
        raise InputError(f"{file}: {times.height} times, and {path} has {source.frame.height} poses")
    return replace(source, frame=source.frame.with_columns(times["timestamp"]))


def _numbers(path: Path, columns: tuple[str, ...]) -> Array | None:
    """The rows [n, k] of a text of so many columns; None if it is no such text."""
    try:
        source = readers.read(path, columns=columns)
    except InputError:
        return None
    values = np.column_stack([source.numbers(ColumnMap("gz_dps", name)) for name in columns])
    values = values[np.isfinite(values).all(axis=1)]
    return values if len(values) > 1 else None
