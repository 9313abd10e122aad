"""Recordings without a table: free motion beside motion capture, and turns by hand between rests."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from .recording import Array, Random, Recording, Run

REST_S, TURN_S = 2.4, 1.4


def freehand(made: Recording, random: Random, seconds: float, warmth: Callable[[Array], Array]) -> Recording:
    """The runs of a recording with motion capture or by hand."""
    runs = int(random.integers(1, 4)) if made.reference == "three" else 1
    n = int(seconds / runs * made.sensor.rate_hz)
    t_s = np.round(np.arange(n) / made.sensor.rate_hz, 6)
    if made.reference == "three":
        made.ref_noise_dps = float(random.choice([0.02, 0.05]))
        made.offset_s = random.uniform(-1.0, 1.0)
        made.turned = Rotation.random(random_state=int(random.integers(2**31))).as_matrix()
    at_s = 0.0
    for k in range(runs):
        on_s, at_s = at_s + 20.0, at_s + 23.0
        w_at, segments = _waves(random) if made.reference == "three" else _hands(random, t_s)
        acc_g = _gravity(w_at, t_s, random)
        heat_c = 1.5 * (1 - np.exp(-(at_s + t_s - on_s) / 60.0))
        made.runs.append(Run(
            k, 1, "up", made.axis, t_s, at_s, at_s - on_s, 0.0, w_at, np.zeros(n), warmth(at_s + t_s) + heat_c, acc_g,
            segments=segments,
        ))  # fmt: skip
        at_s += t_s[-1] + 20.0
    return made


Segments = tuple[tuple[slice, bool], ...]


def _waves(random: Random) -> tuple[Callable[[Array], Array], Segments]:
    """A smooth random motion up to 2 Hz about three axes."""
    f_hz, phase = random.uniform(0.1, 2.0, (10, 3)), random.uniform(0, 2 * np.pi, (10, 3))
    size = random.normal(0, random.choice([20.0, 60.0]) / np.sqrt(5), (10, 3))

    def w_at(t_s: Array) -> Array:
        return np.array([
            sum(size[k, i] * np.sin(2 * np.pi * f_hz[k, i] * t_s + phase[k, i]) for k in range(10)) for i in range(3)
        ])  # fmt: skip

    return w_at, ()


def _hands(random: Random, t_s: Array) -> tuple[Callable[[Array], Array], Segments]:
    """Rests, and between them quick turns of 60 to 180 deg about any axis; of a turn, only the net angle is known."""
    turns: list[tuple[float, float, Array]] = []
    segments: list[tuple[slice, bool]] = []
    rate_hz, at_s = 1 / float(t_s[1] - t_s[0]), 0.0
    while at_s < t_s[-1] - REST_S:
        rest_s, turn_s = REST_S * random.uniform(1.0, 1.5), TURN_S * random.uniform(0.8, 1.5)
        about = np.eye(3)[random.integers(3)] + 0.2 * random.standard_normal(3)
        degrees = random.choice([-1.0, 1.0]) * random.choice([90.0, 90.0, 180.0]) * random.uniform(0.8, 1.1)
        start, middle, end = (int(s * rate_hz) for s in (at_s, at_s + rest_s, at_s + rest_s + turn_s))
        segments.append((slice(start, min(middle, t_s.size)), False))
        at_s += rest_s + turn_s
        if end < t_s.size:
            turns.append((middle / rate_hz, (end - middle) / rate_hz, degrees * about / np.linalg.norm(about)))
            segments.append((slice(middle, end), True))

    def w_at(times: Array) -> Array:
        w = np.zeros((3, times.size))
        for begun_s, length_s, angle_deg in turns:
            first, last = np.searchsorted(times, [begun_s, begun_s + length_s])
            part = (times[first:last] - begun_s) / length_s
            w[:, first:last] += np.outer(angle_deg * 2 / length_s, np.sin(np.pi * part) ** 2)
        return w

    return w_at, tuple((rows, net) for rows, net in segments if rows.stop > rows.start)


def _gravity(w_at: Callable[[Array], Array], t_s: Array, random: Random) -> Array:
    """Gravity [3, n] in the moving sensor, by its rates in the middle of each step."""
    step_s = float(t_s[1] - t_s[0])
    turns = Rotation.from_rotvec(-np.radians(w_at(t_s[:-1] + step_s / 2)).T * step_s).as_matrix()
    out = np.empty((3, t_s.size))
    at = random.standard_normal(3)
    out[:, 0] = at = at / np.linalg.norm(at)
    for i, turn in enumerate(turns):
        at = turn @ at
        out[:, i + 1] = at
    return out
