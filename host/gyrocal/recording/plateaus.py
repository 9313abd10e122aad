"""Stretches of a recording in which the sensor lies still or turns steadily: the runs that one file holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gyrocal.errors import InputError
from gyrocal.recording.cut import Cut, Edge
from gyrocal.recording.run import AXES, Array
from gyrocal.recording.stamps import step_range_s

WINDOW_S = 0.25
"""Length of the windows whose means are compared, s."""
LEAST_S = 2.0
"""Shortest plateau, s."""
LEAST_REST_S = 1.0
"""Shortest rest before and after a known turn, s."""
STEP_DPS, STEP_PART, STEP_ERRORS = 0.5, 0.01, 6.0
"""A step between the means of two windows that a plateau allows: deg/s, part of the rate, and standard errors of the noise."""
REST_DPS = 5.0
"""Largest reading of a sensor at rest that is taken for its bias, dps."""
APART_DPS, APART_PART = 5.0, 0.1
"""Two plateaus are of different rates if they are further apart than this, deg/s, and than this part of the larger rate."""
OFF = 0.15
"""Largest part by which a reading is off the table's rate: the scale beyond which no gyroscope is believed."""
MARGIN_S = 0.25
"""What a known turn keeps of the rests about it, s."""
MOST = 24
"""Plateaus above which a recording is a movement by hand, and no sequence of runs."""
PART = 128
"""Windows that are looked at at a time, because memory for all costs more than they."""


@dataclass(frozen=True)
class Plateau:
    """Samples ``start`` to ``stop`` (not taken), the times from the first sample, s, and the mean rates [3], deg/s."""

    start: int
    stop: int
    start_s: float
    stop_s: float
    mean_dps: Array

    @property
    def at_rest(self) -> bool:
        """True if no axis reads more than a bias."""
        return float(np.abs(self.mean_dps).max()) < REST_DPS

    @property
    def axis(self) -> int:
        """The axis that turns most."""
        return int(np.argmax(np.abs(self.mean_dps)))


def find(t_s: Array, gyro_dps: Sequence[Array]) -> list[Plateau]:
    """The plateaus of the readings [n] of each axis, deg/s, at increasing times [n], s."""
    size = max(4, round(WINDOW_S * (t_s.size - 1) / max(float(t_s[-1] - t_s[0]), 1e-9)))
    count = t_s.size // size
    if count < 4:
        return []
    means, bends = (np.column_stack(found) for found in zip(*(_windows(axis, size, count) for axis in gyro_dps), strict=True))
    local = np.minimum(bends[1:], bends[:-1])  # a motor shakes a table at some rates; of two windows one is steady
    noise = np.sqrt(np.maximum(np.median(bends, axis=0), local) / 6 / size)
    turning = np.abs(means[1:]).max(axis=1, keepdims=True)  # other axes wobble with it
    allowed = np.maximum(STEP_DPS, STEP_ERRORS * noise) + STEP_PART * turning
    joined = np.all(np.abs(np.diff(means, axis=0)) < allowed, axis=1)
    found = []
    for first, last in _groups(joined, means, allowed):
        start, stop = first * size, (last + 1) * size if last + 1 < count else t_s.size
        seconds = float(t_s[stop - 1] - t_s[start])
        if seconds >= LEAST_REST_S:
            mean = np.zeros(len(AXES))
            mean[: len(gyro_dps)] = [axis[start:stop].mean() for axis in gyro_dps]
            found.append(Plateau(start, stop, float(t_s[start] - t_s[0]), float(t_s[stop - 1] - t_s[0]), mean))
    return found


def _windows(readings: Array, size: int, count: int) -> tuple[Array, Array]:
    """The mean [count] and the mean square of second differences [count] of windows of readings [n], some at a time."""
    means, bends = np.empty(count), np.empty(count)
    for first in range(0, count, PART):
        last = min(first + PART, count)
        windows = readings[first * size : last * size].reshape(last - first, size)
        means[first:last] = windows.mean(axis=1)
        bends[first:last] = np.mean(np.diff(windows, 2, axis=1) ** 2, axis=1)
    return means, bends


def _groups(joined: np.ndarray[Any, np.dtype[np.bool_]], means: Array, allowed: Array) -> list[tuple[int, int]]:
    """First and last window of each sequence whose means stay about that of its first windows."""
    groups, first = [], 0
    for k in range(1, len(means)):
        level = np.median(means[first : min(k, first + 4)], axis=0)
        if not joined[k - 1] or np.any(np.abs(means[k] - level) > 2 * allowed[k - 1]):
            groups.append((first, k - 1))
            first = k
    return [*groups, (first, len(means) - 1)]


def of_several_rates(found: Sequence[Plateau]) -> list[Plateau]:
    """The plateaus of a recording that holds several runs; none if they are of one rate, or of a movement by hand."""
    long = [p for p in found if p.stop_s - p.start_s >= LEAST_S]
    if not 2 <= len(long) <= MOST:
        return []
    means = np.array([p.mean_dps for p in long])
    apart = np.ptp(means, axis=0).max()
    return long if apart > max(APART_DPS, APART_PART * float(np.abs(means).max())) else []


def at_rates(label: str, columns: Mapping[str, Array], whole: Cut, rates_dps: Sequence[float]) -> list[Cut]:
    """A run of each plateau of a table, its columns by target; its true rate is the nearest of ``rates_dps``, or 0 at rest.

    ``rates_dps`` are the table's, which a sensor whose face is down reads with the opposite sign. Raises InputError for a
    plateau that is near none of them or near two, and for a rate that no plateau has.
    """
    gyro = [columns.get(f"g{a}_dps", np.zeros(columns["t_s"].size)) for a in AXES]
    found = [p for p in find(columns["t_s"], gyro) if p.stop_s - p.start_s >= LEAST_S]
    sign = -1.0 if whole.meta.get("face") == "down" else 1.0
    cuts = []
    for p, name in zip(found, _names(found), strict=True):
        rate_dps = 0.0 if p.at_rest else _nearest(label, p, rates_dps, sign)
        facts = {"table_rate_dps": rate_dps} | ({} if p.at_rest else {"axis": AXES[p.axis]})
        stop = None if p.stop == columns["t_s"].size else Edge(p.stop_s, True)
        cuts.append(Cut(name, Edge(p.start_s, True), stop, {**whole.meta, **facts}))
    used = {cut.meta["table_rate_dps"] for cut in cuts}
    unused = [rate for rate in rates_dps if rate not in used and rate != 0]
    if unused or not cuts:
        read = ", ".join(_read(found))
        missed = f"{unused[0]:g} dps" if unused else "any rate"
        where = f"there are plateaus at {read}" if read else "none is found"
        raise InputError(
            f"{label}: --rates: no plateau of {LEAST_S:g} s or more is at {missed}; {where}. Where readings vary slowly within "
            "a plateau it is not found: cut the file by --run"
        )
    return cuts


def _nearest(label: str, p: Plateau, rates_dps: Sequence[float], sign: float) -> float:
    """The stated rate that a plateau's reading is nearest to."""
    read_dps = float(p.mean_dps[p.axis])
    near = sorted((abs(read_dps - sign * rate), rate) for rate in rates_dps if rate != 0)
    where = f"{label}: --rates: the plateau from {p.start_s:.2f} to {p.stop_s:.2f} s reads {read_dps:.4g} dps"
    if not near or near[0][0] > REST_DPS + OFF * abs(near[0][1]):
        raise InputError(f"{where}, and no stated rate is near; add the table's rate there, or cut the file by --run")
    if len(near) > 1 and near[0][0] > near[1][0] / 2:
        raise InputError(f"{where}, near {near[0][1]:g} and {near[1][1]:g} dps; cut the file by --run")
    return near[0][1]


def _names(found: Sequence[Plateau]) -> list[str]:
    """A name for each plateau: ``rest_1``, ``z_1``, ``z_2`` ..."""
    names, numbers = [], {"rest": 0, **dict.fromkeys(AXES, 0)}
    for p in found:
        kind = "rest" if p.at_rest else AXES[p.axis]
        numbers[kind] += 1
        names.append(f"{kind}_{numbers[kind]}")
    return names


def options(found: Sequence[Plateau]) -> list[str]:
    """The options that make a run of each plateau, with the rates as they are read."""
    told = []
    for p, name in zip(found, _names(found), strict=True):
        facts = "rate=0" if p.at_rest else f"axis={AXES[p.axis]},rate={p.mean_dps[p.axis]:.3g}"
        told.append(f"--run {name}:{p.start_s:.2f}s:{p.stop_s:.2f}s:{facts}")
    return told


def _read(found: Sequence[Plateau]) -> list[str]:
    return [f"{p.mean_dps[p.axis]:.3g}" for p in found if not p.at_rest]


def about_a_turn(found: Sequence[Plateau], name: str, meta: Mapping[str, Any], end: int) -> list[Cut]:
    """The rests before and after a turn whose angle is known, and the turn, as runs of one file; none without both rests."""
    if len(found) < 2 or not (found[0].at_rest and found[-1].at_rest) or found[0].start > 0 or found[-1].stop < end:
        return []
    first, last = found[0], found[-1]
    if first.stop_s + MARGIN_S > last.start_s:
        return []
    still = {key: value for key, value in meta.items() if key not in ("turn_deg", "turn_se_deg")} | {"table_rate_dps": 0.0}
    edges = [Edge(first.stop_s - MARGIN_S, True), Edge(last.start_s + MARGIN_S, True)]
    return [
        Cut(f"{name}_rest_before", None, edges[0], still), Cut(name, edges[0], edges[1], dict(meta)),
        Cut(f"{name}_rest_after", edges[1], None, still),
    ]  # fmt: skip


def cut(label: str, columns: Mapping[str, Array], whole: Cut) -> list[Cut]:
    """A whole table, its columns by target, as one run, or as a turn of known angle with the rests about it.

    Raises InputError if it holds several rates and one or none is stated, with the options that cut it.
    """
    t_s = columns["t_s"]
    gyro = [columns[f"g{a}_dps"] for a in AXES if f"g{a}_dps" in columns]
    if t_s.size < 2 or step_range_s(t_s)[0] <= 0 or len(gyro) < len(AXES):
        return [whole]
    found = find(t_s, gyro)
    if whole.meta.get("turn_deg") is not None:
        return about_a_turn(found, whole.name, whole.meta, t_s.size) or [whole]
    several, rate_dps = of_several_rates(found), whole.meta.get("table_rate_dps")
    if not several or rate_dps == 0:
        return [whole]
    stated = "its true rate is not known" if rate_dps is None else f"one rate, {rate_dps:g} dps, is stated"
    raise InputError(
        f"{label}: {stated}, and the readings show {len(several)} plateaus; state the rate of each: --rates or --run",
        [
            "as it is read here; put the table's own rates in their place:",
            f"  --rates {','.join(dict.fromkeys(_read(several)))}", "or one by one:", *(f"  {one}" for one in options(several)),
            "or all of it as one run:", "  --run all::",
        ],
    )  # fmt: skip
