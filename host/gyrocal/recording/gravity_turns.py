"""Gravity's direction in a moving sensor, as its accelerometer shows it, and as rates turn it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyrocal.recording.session import Array
from gyrocal.recording.stretches import Index, Mask

LOOKS_S = (0.3, 1.0, 3.0)
"""Times over which the turn of gravity is compared with that of the rates, s."""
MEAN_S = 0.1
"""Time over which accelerations are averaged, s."""
STEADY = 0.15
"""Accelerations whose size is off the median by a larger part show more than gravity."""
FEWEST_LOOKS = 8
MOST_STEPS = 200_000
"""Samples that are integrated at most."""


@dataclass(frozen=True)
class Directions:
    """Gravity at the samples [n]: unit vectors [n, 3], True where the accelerometer shows little else, and the mean step, s."""

    up: Array
    steady: Mask
    step_s: float
    edge: int
    """Samples at either end that have too few neighbours."""


def directions(t_s: Array, acc: Array) -> Directions | None:
    """Gravity by accelerations [n, 3] in any unit, all of which are finite; None for too few samples."""
    if t_s.size < 10 or t_s[-1] <= t_s[0]:
        return None
    step_s = float(t_s[-1] - t_s[0]) / (t_s.size - 1)
    wide = max(1, round(MEAN_S / step_s))
    mean = np.column_stack([np.convolve(column, np.ones(wide) / wide, "same") for column in acc.T])
    size = np.linalg.norm(mean, axis=1)
    steady = np.abs(size / np.median(size) - 1) < STEADY
    return Directions(mean / np.maximum(size, 1e-12)[:, None], np.asarray(steady), step_s, wide)


def looks(moving: Mask, usable: Mask, steps: int, edge: int = 0, most_steps: int = MOST_STEPS) -> Index:
    """The first samples of the looks of so many steps in whose middle the sensor moves, with usable ends; none if too few."""
    starts = np.arange(edge, max(edge, moving.size - steps - edge))
    starts = starts[moving[starts + steps // 2] & usable[starts] & usable[starts + steps]]
    if starts.size < FEWEST_LOOKS * steps:  # looks overlap
        return starts[:0]
    return starts[:: max(1, starts.size * steps // most_steps)]


def off_after(up: Array, turns_rad: Array, starts: Index, steps: int) -> Array:
    """The squared distance of gravity's direction after some steps from where the turns [n, 3] bring it, for each start."""
    now = up[starts]
    for k in range(steps):
        now = after_turn(now, turns_rad[starts + k])
    return np.asarray(np.sum((up[starts + steps] - now) ** 2, axis=1))


def after_turn(up: Array, turn_rad: Array, times: Array | float = 1.0) -> Array:
    """Directions [..., 3] that are fixed in space, as a body sees them that turned by vectors [..., 3], rad, ``times`` as far.

    What is fixed in space moves the other way.
    """
    angle = np.linalg.norm(turn_rad, axis=-1, keepdims=True)
    axis = turn_rad / np.maximum(angle, 1e-12)
    along, by = axis * np.sum(axis * up, axis=-1, keepdims=True), times * angle
    return np.asarray(along + (up - along) * np.cos(by) - np.cross(axis, up) * np.sin(by))
