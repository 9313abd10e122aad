"""A reference that was recorded in a file of its own, brought to the times of the sensor's samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gyrocal.errors import InputError
from gyrocal.recording import readers
from gyrocal.recording.column_map import QUATERNION, REFERENCES, ColumnMap, Scaling
from gyrocal.recording.convert import convert, even, rate_of
from gyrocal.recording.guess import Guess, guess_reference
from gyrocal.recording.session import Array
from gyrocal.recording.stamps import typical_step_s
from gyrocal.recording.timing import between

REACH = 3.0
"""Steps of the reference. A moment between two samples of it that are further apart has no reference."""


@dataclass(frozen=True)
class SecondFile:
    """The file of the reference: ``maps`` as for the sensor's file, with ``t_s``; ``clock`` "same" if both have one clock."""

    path: Path
    maps: Sequence[str]
    clock: str = "same"
    topic: str | None = None

    def guessed(self) -> tuple[SecondFile, tuple[Guess, ...]]:
        """The file with a guess at its columns; as it is, with no guess, if they are given."""
        if self.maps:
            return self, ()
        found = tuple(guess_reference(readers.read(self.path, topic=self.topic)))
        return replace(self, maps=[g.map for g in found]), found

    def columns(self, t_s: Array, start_s: float, scaling: Scaling) -> dict[str, Array]:
        """The reference's columns at the sensor's times ``t_s`` [n], s, which count from ``start_s`` of its clock; [n], NaN
        where there is none.

        With clock "own" times are taken as they are if both files overlap in time, and else as if both began together.
        """
        mappings = [ColumnMap.parse(text, scaling, "--ref-map") for text in self.maps]
        by_target = {m.target: m for m in mappings}
        other = sorted(set(by_target) - {"t_s", *REFERENCES})
        if other or "t_s" not in by_target or len(by_target) < 2:
            wrong = f"{other[0]} is no reference" if other else "map t_s and a reference"
            raise InputError(f"--ref-map: {wrong}; references are {', '.join(REFERENCES)}")
        source = readers.read(self.path, [m.column for m in mappings], topic=self.topic)
        source.check_has([m.column for m in mappings])
        columns = dict(convert(source, mappings, scaling.rate_hz).columns)
        times, _ = even(columns.pop("t_s"), lambda _: str(self.path), self.path.name)
        if "rate_ref_dps" in columns and by_target["rate_ref_dps"].is_angle_of_rate:
            columns["rate_ref_dps"] = rate_of(times, columns["rate_ref_dps"])
        apart_s = source.start_s(by_target["t_s"]) - start_s
        if apart_s + times[-1] < t_s[0] or apart_s + times[0] > t_s[-1]:
            if self.clock == "same":
                raise InputError(
                    f"{self.path}: its times do not overlap with the sensor's (it begins {apart_s:+.6g} s from them); if it "
                    "was stamped by another clock: --ref-clock own"
                )
            apart_s = 0.0
        return _at(t_s, times + apart_s, columns)


def _at(t_s: Array, known_s: Array, columns: dict[str, Array]) -> dict[str, Array]:
    """Columns at ``known_s``, taken at ``t_s`` on smooth curves. Quaternions turn the shorter way and keep their length."""
    if set(QUATERNION) <= set(columns):
        q = np.column_stack([columns[name] for name in QUATERNION])
        dots = np.nansum(q[1:] * q[:-1], axis=1)
        q *= np.concatenate([[1.0], np.cumprod(np.where(dots < 0, -1.0, 1.0))])[:, None]
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
