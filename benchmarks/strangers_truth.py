"""What a public recording holds, by numpy, pyulog and rosbags alone: ``strangers.toml`` says how its files are read."""

from __future__ import annotations

import gzip
import os
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LIST = Path(__file__).with_name("strangers.toml")
STRANGERS = Path(os.environ.get("GYROCAL_STRANGERS") or Path(__file__).parents[2] / "shared" / "strangers")
MOVES_DPS = 10.0
"""Means of seconds that differ by more are of a movement, and so is a scatter that is larger."""
BIAS_DPS = 50.0
"""No bias is larger."""
TOGETHER = 10
"""Steps of the time that are taken together."""


@dataclass(frozen=True)
class Recording:
    """A file of a repository; the head of ``strangers.toml`` explains each key."""

    kind: str
    repository: dict[str, str]
    path: str
    units: tuple[float, float] = (1.0, 1.0)
    at: tuple[int, ...] = ()
    names: tuple[str, ...] = ()
    skip: int = 0
    header: int | None = None
    delimiter: str = ","
    second: int | None = None
    acc: tuple[int, ...] = ()
    g: float = 1.0
    rate_hz: float | None = None
    rate_within: float = 0.01
    moves: bool = False
    topic: str | None = None
    corrected: bool = False
    reference: str | None = None
    refused: str | None = None
    half: str = ""
    always: tuple[str, ...] = ()
    options: tuple[str, ...] = field(default=())

    @property
    def name(self) -> str:
        """Repository and file, short."""
        path = Path(self.path)
        parts = [self.repository["name"].split("/")[1], path.parts[-4] if path.match("mav0/*/data.csv") else path.stem]
        return ": ".join(parts) + (f", {self.topic}" if self.always else "")

    @property
    def folder(self) -> Path:
        """Where the reader's clone is."""
        return STRANGERS / self.repository["name"]

    @property
    def file(self) -> Path:
        """The file in it."""
        return self.folder / self.path


@dataclass(frozen=True)
class Truth:
    """Times [n], s, from the first; rates [n, 3], deg/s; accelerations [n, 3], g; the names of the columns of the rates."""

    t_s: Array
    rates_dps: Array
    acc_g: Array | None
    names: tuple[str, ...]

    @property
    def step_s(self) -> float:
        """The median mean of ten successive steps, of fewer in a short file: bursts fill them, a loss leaves them alone."""
        count = max(1, min(TOGETHER, len(self.t_s) // 4))
        return float(np.median(self.t_s[count:] - self.t_s[:-count])) / count

    @property
    def moves(self) -> bool:
        """True if the means over single seconds differ as no bias does, or the readings scatter or stand as at no rest."""
        if self.rates_dps.std(axis=0).max() > MOVES_DPS or np.abs(self.rates_dps.mean(axis=0)).max() > BIAS_DPS:
            return True
        second = np.floor(self.t_s - self.t_s.min()).astype(int)
        counts = np.bincount(second)
        means = [np.bincount(second, r)[counts > 0] / counts[counts > 0] for r in self.rates_dps.T]
        return bool(np.ptp(means, axis=1).max() > MOVES_DPS)


def recordings() -> list[Recording]:
    """The list, in its order."""
    stated = tomllib.loads(LIST.read_text(encoding="utf-8"))

    def one(entry: dict[str, Any]) -> Recording:
        entry["repository"] = stated["repositories"][entry["repository"]]
        return Recording(**{k: tuple(v) if isinstance(v, list) else v for k, v in entry.items()})

    return [one(entry) for entry in stated["recording"]]


def truth_of(one: Recording) -> Truth:
    """What the file holds."""
    if one.file.suffix == ".bag":
        return _of_bag(one)
    if one.file.suffix == ".ulg":
        return _of_ulog(one)
    return _of_text(one)


def _of_ulog(one: Recording) -> Truth:
    from pyulog import ULog

    data = next(d for d in ULog(str(one.file)).data_list if d.name == one.topic).data
    cells = np.column_stack([np.asarray(data[name], dtype=float) for name in one.names])
    t_s = (cells[:, 0] - cells[0, 0]) * one.units[0]
    return Truth(t_s, cells[:, 1:] * one.units[1], None, tuple(f"{one.topic}.{n}" for n in one.names[1:]))


def _of_bag(one: Recording) -> Truth:
    from rosbags.highlevel import AnyReader

    with AnyReader([one.file]) as reader:
        messages = [
            reader.deserialize(raw, link.msgtype)
            for link, _, raw in reader.messages([c for c in reader.connections if c.topic == one.topic])
        ]
    seconds = np.array([m.header.stamp.sec for m in messages], dtype=float)
    t_s = seconds - seconds[0] + 1e-9 * np.array([m.header.stamp.nanosec for m in messages])
    rates = np.array([[m.angular_velocity.x, m.angular_velocity.y, m.angular_velocity.z] for m in messages])
    return Truth(t_s - t_s[0], rates * one.units[1], None, tuple(f"angular_velocity.{a}" for a in "xyz"))


def _of_text(one: Recording) -> Truth:
    raw = one.file.read_bytes()
    text = (gzip.decompress(raw) if raw[:2] == b"\x1f\x8b" else raw).decode("utf-8-sig")
    lines = text.splitlines()
    split = None if one.delimiter == " " else one.delimiter
    header = [cell.strip().strip('"') for cell in lines[one.skip - 1 if one.header is None else one.header].split(split)]
    at = one.at or tuple(header.index(name) for name in one.names)
    timed = len(at) == 4
    rows, acc = [], []
    for before, line in zip([None, *lines[one.skip :]], lines[one.skip :], strict=False):
        if timed and line == before:
            continue
        cells = line.split(split)
        try:
            row = [float(cells[i]) for i in at]
            row[0] += 1e-9 * float(cells[one.second]) if one.second is not None else 0.0
            acc.append([float(cells[i]) for i in one.acc])
        except (ValueError, IndexError):
            continue
        rows.append(row)
    values = np.array(rows)
    if timed:
        t_s = (values[:, 0] - values[0, 0]) * one.units[0]
    else:
        assert one.rate_hz is not None
        t_s = np.arange(len(values)) / one.rate_hz
    names = tuple(header[i] for i in at[-3:]) if len(header) > max(at) else ()
    return Truth(t_s, values[:, -3:] * one.units[1], np.array(acc) * one.g if one.acc else None, names)


def reference_of(one: Recording, truth: Truth) -> tuple[Array, Array]:
    """Scale less 1 and bias, deg/s, of each axis: least squares of the mean rates between the samples of an orientation.

    The second file is EuRoC's: nanoseconds, position, and the quaternion w, x, y, z from body to world.
    """
    assert one.reference is not None
    rows = np.loadtxt(one.folder / one.reference, delimiter=",", skiprows=1, usecols=(0, 4, 5, 6, 7))
    first_ns = float(one.file.read_text(encoding="utf-8").splitlines()[one.skip].split(",")[0])
    t_s, q = (rows[:, 0] - first_ns) * 1e-9, rows[:, 1:] / np.linalg.norm(rows[:, 1:], axis=1, keepdims=True)
    w, v = q[:-1, :1], -q[:-1, 1:]
    turn_w = w * q[1:, :1] - np.sum(v * q[1:, 1:], axis=1, keepdims=True)
    turn_v = w * q[1:, 1:] + q[1:, :1] * v + np.cross(v, q[1:, 1:])
    sine = np.linalg.norm(turn_v, axis=1, keepdims=True)
    angle = 2 * np.arctan2(sine, turn_w)
    angle = (angle + np.pi) % (2 * np.pi) - np.pi
    true_dps = np.degrees(turn_v / np.maximum(sine, 1e-12) * angle) / np.diff(t_s)[:, None]
    steps = np.diff(truth.t_s)[:, None] * (truth.rates_dps[1:] + truth.rates_dps[:-1]) / 2
    turned = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    ours = np.column_stack([np.interp(t_s, truth.t_s, turned[:, i]) for i in range(3)])
    read_dps = np.diff(ours, axis=0) / np.diff(t_s)[:, None]
    inside = (t_s[:-1] >= 0) & (t_s[1:] <= truth.t_s[-1])
    fits = [np.polyfit(true_dps[inside, i], read_dps[inside, i], 1) for i in range(3)]
    return np.array([f[0] - 1 for f in fits]), np.array([f[1] for f in fits])
