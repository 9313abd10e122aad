"""Recordings with a file for each sensor, as phones write them: their tables are joined on time."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import polars as pl

from gyrocal.errors import InputError
from gyrocal.recording.column_map import ColumnMap, Scaling
from gyrocal.recording.guess import time_column
from gyrocal.recording.session import Array
from gyrocal.recording.source import Source
from gyrocal.recording.stamps import typical_step_s
from gyrocal.recording.timing import between

GYROSCOPE = r"gyro(?:scope)?s?|giroscopio|drehrate|angular_?velocity"
OF_OTHERS = r"total_?acceleration|accelerometer|acceleration|accel|acc|temperature|temp"
"""Sensors whose columns are joined to the gyroscope's, in words of a file's name."""
DERIVED = r"uncalibrated|linear|user|gravity"
"""Words of a file of readings that a phone derived, or gives a second time."""
REACH = 3.0
"""Steps of the other sensor. A moment between two of its samples that are further apart has no reading of it."""
Read = Callable[[Path], Source]


@dataclass(frozen=True)
class Files:
    """The files of one recording: that of the gyroscope, and those of other sensors.

    ``columns`` names all columns of files of others that have no header.
    """

    gyroscope: Path
    others: tuple[Path, ...] = ()
    columns: Mapping[Path, Sequence[str]] = field(default_factory=dict)


def of_stated(gyroscope: Path, others: Sequence[Path | str]) -> Files:
    """A recording whose other files were stated, each as ``FILE`` or with all of its columns, ``FILE:ax,ay,az,time``."""
    named = {}
    for text in map(str, others):
        path, colon, names = text.rpartition(":")
        stated = bool(colon) and "," in names and not Path(text).exists()
        named[Path(path if stated else text)] = [name.strip() for name in names.split(",")] if stated else None
    return Files(gyroscope, tuple(named), {path: names for path, names in named.items() if names})


def recordings(files: Sequence[Path]) -> list[Files]:
    """The recordings in a folder of tables. Files whose names differ in the name of the sensor alone are of one recording.

    Numbers behind the sensors' names count the sensors, as in ``gyroscope_2`` beside ``accelerometer_1``, if no recording has
    files with the same number.
    """
    sensor = rf"{GYROSCOPE}|{OF_OTHERS}"
    for one in (sensor, rf"(?:{sensor})_?\d+"):
        found = _grouped(files, one)
        if any(f.others for f in found):
            return found
    return [Files(file) for file in files]


def _grouped(files: Sequence[Path], sensor: str) -> list[Files]:
    """The recordings with a gyroscope among files whose names are the same without the sensor's."""
    groups: dict[str, list[Path]] = {}
    for file in files:
        groups.setdefault(re.sub(sensor, "*", _words(file)), []).append(file)
    found = []
    for group in groups.values():
        own = [f for f in group if not re.search(DERIVED, _words(f))]
        gyroscopes = [f for f in own if re.search(GYROSCOPE, _words(f))]
        others = [f for f in own if f not in gyroscopes and re.search(OF_OTHERS, _words(f))]
        if len(gyroscopes) == 1:
            found.append(Files(gyroscopes[0], tuple(sorted(others, key=lambda f: "total" not in _words(f)))))
    return found


def _words(file: Path) -> str:
    return re.sub(r"[ -]+", "_", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", stem_of(file))).lower()


def read(files: Files, read_one: Read, stated: bool = False) -> Source:
    """The gyroscope's table with the columns of the other sensors at its times, ``FILE.COLUMN`` each.

    Readings lie on a smooth curve through the sensor's own; where there are none, the cells are empty. InputError where a table
    has no time or another one; ``stated`` False leaves such a file of another sensor out.
    """
    source = read_one(files.gyroscope)
    if not files.others:
        return source
    time = _time_of(source)
    t_s = source.numbers(time)
    named = {name: f"{stem_of(files.gyroscope)}.{name}" for name in source.frame.columns if name != time.column}
    plain = all(len(name) == 1 for name in list(named)[-3:])
    frame = source.frame.rename(named) if plain else source.frame
    for other in files.others:
        try:
            frame = frame.with_columns(_at(t_s, source.start_s(time), read_one(other), other))
        except InputError:
            if stated:
                raise
    return replace(source, frame=frame, names=tuple(frame.columns))


def stem_of(file: Path) -> str:
    """The name of a file without its endings, such as ``.csv.gz``."""
    return file.name.split(".")[0]


def _time_of(source: Source) -> ColumnMap:
    found = time_column(source)
    if found is None:
        raise InputError(f"{source.label}: no time is recognized, by which it could be joined with the other files")
    return ColumnMap.parse(found.map, Scaling())


def _at(t_s: Array, start_s: float, other: Source, file: Path) -> list[pl.Series]:
    """The columns of numbers of another table at times [n], s, that count from ``start_s`` of its clock."""
    time = _time_of(other)
    known_s = other.numbers(time) + (other.start_s(time) - start_s)
    once = np.isfinite(known_s)
    once[1:] &= np.diff(np.maximum.accumulate(np.where(once, known_s, -np.inf))) > 0
    if once.sum() < 2 or known_s[once][-1] < np.nanmin(t_s) or known_s[once][0] > np.nanmax(t_s):
        raise InputError(f"{file}: its times do not overlap with those of the gyroscope")
    reach_s = REACH * typical_step_s(known_s[once])
    inside = np.where(np.isfinite(t_s), t_s, np.nanmin(t_s))
    columns = []
    for name in other.frame.columns:
        values = other.numbers(ColumnMap("gz_dps", name))[once]
        good = np.isfinite(values)
        if name != time.column and good.sum() > 1:
            columns.append(pl.Series(f"{stem_of(file)}.{name}", between(known_s[once][good], values[good], inside, reach_s)))
    return columns
