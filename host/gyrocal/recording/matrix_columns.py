"""Rotation matrices in nine columns of a table, as the unit quaternions that a session holds."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import polars as pl

from gyrocal.recording.column_map import ColumnMap
from gyrocal.recording.column_names import bare_name
from gyrocal.recording.orientation import UNIT_WITHIN
from gyrocal.recording.session import Array
from gyrocal.recording.source import Source

OWN = r"(?:r|rots?|rotations?|rotation_?matri(?:x|ces)|rot_?mat(?:rix|s)?|m|mats?|matri(?:x|ces)|dcms?)"
STEM = rf"(?:.*[/._])?{OWN}"


def is_of_matrix(name: str) -> bool:
    """True for the name of a column that :func:`with_quaternion` adds."""
    return re.fullmatch(r"(?:.*[/._])?matrix\.q[wxyz]", name) is not None


def with_quaternion(source: Source) -> Source:
    """The table with the quaternions of its rotation matrices (body to fixed frame), if it has nine columns of such.

    The quaternions are ``matrix.qw`` to ``matrix.qz``. The nine columns are named by row and column from 1 or 0 (``r11`` to
    ``r33``, ``R00``), or are an array's in the order of its rows. Rows of length 1 at right angles make a rotation; a tracker
    that saw nothing writes zeros, and such a matrix is missing.
    """
    names = _nine(source)
    if not names:
        return source
    cells = np.column_stack([source.numbers(ColumnMap("gz_dps", name)) for name in names])
    known = np.isfinite(cells).all(axis=1) & cells.any(axis=1)
    if known.sum() < 2:
        return source
    matrices = cells[known].reshape(-1, 3, 3)
    if not _turn(matrices):
        return source
    from scipy.spatial.transform import Rotation

    found = np.full((len(cells), 4), np.nan)
    found[known] = np.roll(Rotation.from_matrix(matrices).as_quat(), 1, axis=1)
    prefix = re.match(rf"((?:.*[/._])?){OWN}[^a-z]*$", bare_name(names[0])[0])
    before = prefix[1] if prefix else ""
    columns = [pl.Series(f"{before}matrix.q{part}", column) for part, column in zip("wxyz", found.T, strict=True)]
    return replace(source, frame=source.frame.with_columns(columns))


def _turn(matrices: Array) -> bool:
    """True if matrices [n, 3, 3] are rotations and no reflections, within the rounding of a file."""
    square = matrices @ matrices.transpose(0, 2, 1)
    return bool(np.allclose(square, np.eye(3), atol=UNIT_WITHIN) and np.median(np.linalg.det(matrices)) > 0)


def _nine(source: Source) -> list[str]:
    """The columns of a matrix in the order of its rows; none if there are not nine."""
    bare = {bare_name(name)[0]: name for name in reversed(source.frame.columns)}
    for first in (1, 0):
        wanted = [rf"{STEM}_?[\[(]?{i + first}[\])]?[_,]?[\[(]?{j + first}[\])]?" for i in range(3) for j in range(3)]
        if names := _of_patterns(wanted, bare):
            return names
    return _of_patterns([rf"{STEM}(?:\.{k}|\[{k}\])" for k in range(9)], bare)


def _of_patterns(patterns: list[str], bare: dict[str, str]) -> list[str]:
    found = [next((name for word, name in bare.items() if re.fullmatch(pattern, word)), None) for pattern in patterns]
    return [name for name in found if name is not None] if None not in found else []
