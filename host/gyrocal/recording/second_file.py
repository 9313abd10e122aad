"""A reference that was recorded in a file of its own, brought to the times of the sensor's samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gyrocal.errors import InputError
from gyrocal.recording import readers
from gyrocal.recording.column_map import ColumnMap, Scaling
from gyrocal.recording.convert import convert, rate_of
from gyrocal.recording.first_rows import Taken, first_rows
from gyrocal.recording.guess import Guess, guess_reference
from gyrocal.recording.guess_units import typical_rate_dps
from gyrocal.recording.matrix_columns import is_of_matrix, with_quaternion
from gyrocal.recording.measured_rates import QUATERNION, REFERENCES
from gyrocal.recording.orientation import of_one_sign
from gyrocal.recording.session import Array
from gyrocal.recording.source import Source
from gyrocal.recording.stamped import even
from gyrocal.recording.stamps import typical_step_s
from gyrocal.recording.stated import rate_hz as stated_rate_hz
from gyrocal.recording.timing import between
from gyrocal.recording.trajectory import KITTI, columns_of, with_times

ORDER_OF_TUM = "no header: the order of TUM, in which w is the last of the quaternion; other orders are possible too"
REACH = 3.0
"""Steps of the reference. A moment between two samples of it that are further apart has no reference."""


@dataclass(frozen=True)
class SecondFile:
    """The file of the reference: ``maps`` as for the sensor's file; ``clock`` "same" if both have one clock.

    Without ``t_s`` its samples begin with the sensor's, at the rate that a line above its table states, or else ``--rate-hz``.
    ``names`` are all columns of a text without a header. ``later_s`` is added to the times of a clock of its own, s.
    """

    path: Path
    maps: Sequence[str]
    clock: str = "same"
    topic: str | None = None
    names: Sequence[str] | None = None
    later_s: float = 0.0

    def guessed(self, rate_hz: float | None = None) -> tuple[SecondFile, tuple[Guess, ...]]:
        """The file with a guess at its columns; as it is, with no guess, if they are given."""
        if self.maps:
            return self, ()
        file, found = self, []
        try:
            source = self._read()
        except InputError:
            names = None if self.names else columns_of(self.path)
            if names is None:
                raise
            file = replace(self, names=names)
            why = ORDER_OF_TUM if "qw" in names else "no header: poses of KITTI, with the times of times.txt"
            source, found = file._read(), [Guess(",".join(names), why, "--ref-columns")]
        found += guess_reference(source, _rate_hz(source, rate_hz))
        return replace(file, maps=[g.map for g in found if g.option == "--ref-map"]), tuple(found)

    def first_rows(self, scaling: Scaling, guessed: Sequence[Guess]) -> tuple[Taken, ...]:
        """The first rows of the columns that are taken."""
        mappings = self._mappings(scaling)
        source = self._read([m.column for m in mappings])
        source.check_has([m.column for m in mappings])
        return first_rows(source, mappings, guessed)

    def _mappings(self, scaling: Scaling) -> list[ColumnMap]:
        return [ColumnMap.parse(text, scaling, "--ref-map") for text in self.maps]

    def _read(self, names: Sequence[str] = ()) -> Source:
        asked = () if any(map(is_of_matrix, names)) or tuple(self.names or ()) == KITTI else names
        source = readers.read(self.path, asked, self.names, topic=self.topic, option="--ref-")
        return with_quaternion(with_times(source, self.path, self.names))

    def typical_rate_dps(self, scaling: Scaling) -> float | None:
        """The rms rate of the reference, deg/s; None where it hardly turns."""
        mappings = self._mappings(scaling)
        source = self._read([m.column for m in mappings])
        source.check_has([m.column for m in mappings])
        columns = {m.target: source.numbers(m) for m in mappings}
        if "t_s" not in columns and (rate_hz := _rate_hz(source, scaling.rate_hz)) is not None:
            columns["t_s"] = np.arange(source.frame.height) / rate_hz
        return typical_rate_dps(columns.pop("t_s"), columns) if "t_s" in columns else None

    def motion(self, first_s: float, last_s: float, start_s: float, scaling: Scaling) -> Motion:
        """What the file holds, on the sensor's clock, whose samples are from ``first_s`` to ``last_s``, which count from
        ``start_s`` of that clock.

        With clock "own" times are taken as they are if both files overlap in time, and else as if both began together.
        """
        mappings = self._mappings(scaling)
        by_target = {m.target: m for m in mappings}
        other = sorted(set(by_target) - {"t_s", *REFERENCES})
        source = self._read([m.column for m in mappings])
        rate_hz = _rate_hz(source, scaling.rate_hz)
        if other or not set(by_target) - {"t_s"} or ("t_s" not in by_target and rate_hz is None):
            untimed = "" if "t_s" in by_target or rate_hz is not None else "t_s (or give --rate-hz) and "
            wrong = f"{other[0]} is no reference" if other else f"map {untimed}a reference"
            raise InputError(f"--ref-map: {wrong}; references are {', '.join(REFERENCES)}")
        source.check_has([m.column for m in mappings])
        table = convert(source, mappings, rate_hz)
        columns = dict(table.columns)
        times, _ = even(columns.pop("t_s"), lambda _: str(self.path), self.path.name)
        if "rate_ref_dps" in columns and by_target["rate_ref_dps"].is_angle_of_rate:
            columns["rate_ref_dps"] = rate_of(times, columns["rate_ref_dps"])
        apart_s = source.start_s(by_target["t_s"]) - start_s if "t_s" in by_target else first_s
        if apart_s + times[-1] < first_s or apart_s + times[0] > last_s:
            if self.clock == "same":
                raise InputError(
                    f"{self.path}: its times do not overlap with the sensor's (it begins {apart_s:+.6g} s from them); if it "
                    "was stamped by another clock: --ref-clock own"
                )
            apart_s = 0.0
        return Motion(times + apart_s + self.later_s, columns, f"{source.label}: {table.damage}" if table.damage else "")


def _rate_hz(source: Source, given_hz: float | None) -> float | None:
    """The rate of a reference's samples: that which a line above its table states, or else the given one, Hz."""
    return stated_rate_hz(source.above) or given_hz


@dataclass(frozen=True)
class Motion:
    """A reference's columns [k] at the times ``known_s`` [k], s, of the sensor's clock.

    ``damage`` says what was left out of them or mended.
    """

    known_s: Array
    columns: Mapping[str, Array]
    damage: str = ""

    def at(self, t_s: Array) -> dict[str, Array]:
        """The columns at times [n], s, at which samples were taken; NaN where there is no reference."""
        return _at(t_s, self.known_s, dict(self.columns))


def _at(t_s: Array, known_s: Array, columns: dict[str, Array]) -> dict[str, Array]:
    """Columns at ``known_s``, taken at ``t_s`` on smooth curves. Quaternions turn the shorter way and keep their length."""
    if set(QUATERNION) <= set(columns):
        q = of_one_sign(np.column_stack([columns[name] for name in QUATERNION]))
        columns = columns | dict(zip(QUATERNION, q.T, strict=True))
    step_s = typical_step_s(known_s)
    out = {}
    for name, values in columns.items():
        at = np.isfinite(values)
        if at.sum() < 2:
            raise InputError(f"--ref-map: {name}: fewer than two numbers")
        out[name] = between(known_s[at], values[at], t_s, REACH * step_s)
    if set(QUATERNION) <= set(out):
        norm = np.sqrt(sum(out[name] ** 2 for name in QUATERNION))
        out.update({name: out[name] / norm for name in QUATERNION})
    return out
