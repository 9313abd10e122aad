"""Trajectories without a header, as programs of visual odometry write them: TUM's are read, KITTI's say what they lack."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gyrocal.errors import InputError
from gyrocal.recording import readers
from gyrocal.recording.column_map import ColumnMap
from gyrocal.recording.orientation import UNIT_WITHIN
from gyrocal.recording.session import Array

TUM = ("timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw")
"""The columns of a TUM trajectory: the quaternion's real part is the last."""
KITTI = tuple(f"{part}{row}" for row in "123" for part in ("rx", "ry", "rz", "t"))
"""The columns of KITTI's poses: the rows of a rotation matrix, each with a part of the place."""


def columns_of(path: Path) -> tuple[str, ...] | None:
    """The columns of a text that is a trajectory without a header; None if it is none.

    TUM's rows begin with a time and end with a unit quaternion. InputError for poses of KITTI, which have no times.
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
            raise InputError(
                f"{path}: poses of KITTI, which have no times; write each with its time of times.txt as a row of TUM: "
                f"{' '.join(TUM)}"
            )
    return None


def _numbers(path: Path, columns: tuple[str, ...]) -> Array | None:
    """The rows [n, k] of a text of so many columns; None if it is no such text."""
    try:
        source = readers.read(path, columns=columns)
    except InputError:
        return None
    values = np.column_stack([source.numbers(ColumnMap("gz_dps", name)) for name in columns])
    values = values[np.isfinite(values).all(axis=1)]
    return values if len(values) > 1 else None
