"""An orientation that the sensor computed itself, beside its readings: no reference, but it tells the unit of its rates.

The angle between two orientations is the same in any frame, whichever part of a quaternion is its first.
"""

from __future__ import annotations

import re

import numpy as np

from gyrocal.recording.column_map import ColumnMap, Scaling
from gyrocal.recording.column_names import bare_name, stated_unit
from gyrocal.recording.session import Array
from gyrocal.recording.source import Source

QUATERNION = r"(?:.*[/._ ])?(?:q|qs|quats?|quaternions?|orientations?|rot|rotations?|attitudes?|att|pose|matrix\.q)"
"""Words before the parts of a quaternion, where these are numbers."""
EULER = (
    (r"(?:roll|phi)", r"(?:pitch|theta)", r"(?:yaw|heading|azimuth|psi)"),
    (r"(?:euler|angle)s?[/._]?x", r"(?:euler|angle)s?[/._]?y", r"(?:euler|angle)s?[/._]?z"),
)
LENGTH = 0.01
"""The median length of unit quaternions is off 1 by less."""
MOST_RAD = 2 * np.pi + 0.1
"""Larger angles are degrees."""
WRAPS = 0.05
"""A step within this part of a full turn is one past the end of the range."""


def of_table(source: Source) -> Array | None:
    """The orientations of a table as unit quaternions [n, 4], in any order of their parts; None if it holds none."""
    return _quaternion(source) if (found := _of_angles(source)) is None else found


def _quaternion(source: Source) -> Array | None:
    bare = {bare_name(name)[0]: name for name in reversed(source.frame.columns)}
    for parts in ("wxyz", "0123", "1234"):
        for word in list(bare):
            match = re.fullmatch(rf"(.*?)([/._ \[]?){parts[0]}(\]?)", word)
            if match is None or (parts != "wxyz" and not re.fullmatch(QUATERNION, match[1])):
                continue
            names = [bare.get(f"{match[1]}{match[2]}{part}{match[3]}") for part in parts]
            cells = np.column_stack([source.numbers(ColumnMap("ref_qw", name)) for name in names if name is not None])
            size = np.linalg.norm(cells, axis=1)
            known = np.isfinite(size) & (size > 0)
            if cells.shape[1] == len(parts) and known.any() and abs(float(np.median(size[known])) - 1) < LENGTH:
                return np.where(known[:, None], cells, np.nan) / np.where(known, size, 1.0)[:, None]
    return None


def _of_angles(source: Source) -> Array | None:
    """The orientations of columns of roll, pitch and yaw whose unit is stated or evident."""
    for words in EULER:
        found = [_named(source, rf"(?:.*[/._])?{word}(?:_?(?:angle|deg|degrees|rad))?") for word in words]
        names = [name for name in found if name is not None]
        if len(names) == len(words) and (unit := _unit_of(source, names)) is not None:
            from scipy.spatial.transform import Rotation

            maps = [ColumnMap.parse(f"ref_angle_deg={name}:{unit}", Scaling()) for name in reversed(names)]
            angles_deg = np.column_stack([source.numbers(m) for m in maps])
            known = np.isfinite(angles_deg).all(axis=1)
            turned = np.full((len(angles_deg), 4), np.nan)
            if known.any():
                turned[known] = Rotation.from_euler("ZYX", angles_deg[known], degrees=True).as_quat()
            return turned
    return None


def yaw_of(source: Source) -> tuple[str, str | None] | None:
    """The column of a yaw or a heading, and its unit, None where nothing tells it; None if there is no such column."""
    name = _named(source, rf"(?:.*[/._ ])?{EULER[0][2]}(?:_?(?:angle|deg|degrees|rad))?")
    return None if name is None else (name, _unit_of(source, [name]))


def _named(source: Source, words: str) -> str | None:
    named = (name for name in source.frame.columns if re.fullmatch(words, bare_name(name)[0]))
    return next((name for name in named if stated_unit(name, "angle") or not stated_unit(name, "gyro")), None)


def _unit_of(source: Source, names: list[str]) -> str | None:
    """The unit of one angle or more: stated, or evident where they are too large for radians or go round at a full turn."""
    stated = {stated_unit(name, "angle") for name in names}
    if stated != {None}:
        return stated.pop() if len(stated) == 1 else None
    angles = [source.numbers(ColumnMap("ref_angle_deg", name)) for name in names]
    largest = max(float(np.nanmax(np.abs(each), initial=0.0)) for each in angles)
    if largest > MOST_RAD:
        return "deg"
    steps = np.abs(np.diff(angles[-1]))
    return "rad" if np.any(np.abs(steps / (2 * np.pi) - 1) < WRAPS) else None
