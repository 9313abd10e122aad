"""What a session by hand shows whatever the gyroscope's model: rests, movements, gravity's directions, noise at rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from gyrocal.gravity.accelerometer import Accelerometer, calibrate
from gyrocal.gravity.rests import CHUNK_S, Movement, Rest, filled_acc_g, find
from gyrocal.recording.session import Array, Session
from gyrocal.warning import Warning

BLOCK_S = 0.2
"""Blocks whose means' differences give the noise at low frequencies: a low-pass acts within them, drift takes longer."""
LEAST_NOISE_DPS = 1e-6


@dataclass(frozen=True)
class Chunk:
    """A rest, or ten seconds of a longer one: rows ``start:stop`` of a run, its middle (s), and the index of its rest."""

    run: int
    start: int
    stop: int
    t_s: float
    rest: int

    @property
    def rows(self) -> int:
        return self.stop - self.start


@dataclass(frozen=True)
class Scene:
    """``up`` [rests, 3] holds the unit vectors of gravity's reaction in the common frame.

    ``white_dps`` [3] is the noise of one gyroscope sample at low frequencies.
    """

    session: Session = field(repr=False)
    rests: list[Rest]
    movements: list[Movement]
    chunks: list[Chunk]
    accelerometer: Accelerometer
    up: Array
    white_dps: Array
    warnings: list[Warning]

    @staticmethod
    def of(session: Session) -> Scene:
        """Raises InputError where rests are too few or accelerations are not near 1 g."""
        found = find(session)
        rate_hz = _rate_hz(session)
        gyro = [session.runs[r.run].gyro_dps[r.start : r.stop] for r in found.rests]
        acc = [filled_acc_g(session.runs[r.run])[r.start : r.stop] for r in found.rests]
        white_dps = np.maximum(low_frequency_sd(gyro, rate_hz), LEAST_NOISE_DPS)
        white_g = float(np.sqrt(np.mean(low_frequency_sd(acc, rate_hz) ** 2)))
        accelerometer = calibrate(found.rests, white_g)
        true_g = accelerometer.true_g(np.array([r.acc_g for r in found.rests]))
        up = true_g / np.linalg.norm(true_g, axis=1)[:, None]
        chunks = [c for i, r in enumerate(found.rests) for c in _chunks(session, r, i)]
        return Scene(session, found.rests, found.movements, chunks, accelerometer, up, white_dps, found.warnings)

    @property
    def turned_deg(self) -> Array:
        """How far gravity's direction turns in each movement, shape [movements], deg."""
        cosine = np.sum(self.up[[m.before for m in self.movements]] * self.up[[m.after for m in self.movements]], axis=1)
        return np.asarray(np.rad2deg(np.arccos(np.clip(cosine, -1.0, 1.0))))

    @property
    def cycles(self) -> list[str]:
        return self.session.scenarios


def _rate_hz(session: Session) -> float:
    return float(np.mean([(len(r) - 1) / float(r.sample_s[-1] - r.sample_s[0]) for r in session.runs]))


def low_frequency_sd(stretches: Sequence[Array], rate_hz: float) -> Array:
    """Noise of one sample as means over many show it, shape [3], from stretches [n, 3] at rest.

    Differences of neighbouring block means hold neither a bias nor a slow drift.
    """
    size = max(2, round(BLOCK_S * rate_hz))
    total, count = np.zeros(3), 0
    for values in stretches:
        blocks = values[: len(values) // size * size].reshape(-1, size, 3).mean(axis=1)
        total += np.sum(np.diff(blocks, axis=0) ** 2, axis=0) / 2
        count += max(len(blocks) - 1, 0)
    return np.asarray(np.sqrt(total / max(count, 1) * size))


def _chunks(session: Session, rest: Rest, number: int) -> list[Chunk]:
    parts = max(1, round(rest.seconds / CHUNK_S))
    edges = np.linspace(rest.start, rest.stop, parts + 1).astype(int)
    t_s = session.runs[rest.run].sample_s
    return [
        Chunk(rest.run, int(a), int(b), float(t_s[a:b].mean()), number) for a, b in pairwise(edges)
    ]
