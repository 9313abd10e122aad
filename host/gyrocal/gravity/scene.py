"""Properties of a session by hand that do not depend on a model: rests, movements, directions of gravity, noise at rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from gyrocal.error_model.accelerometer import AccelerometerModel
from gyrocal.error_model.correction import turning_about
from gyrocal.errors import InputError
from gyrocal.gravity.accelerometer import Accelerometer, calibrate
from gyrocal.gravity.rests import CHUNK_S, Movement, Rest, filled_acc_g, find
from gyrocal.gravity.size_of_rates import path_of_turn, wrong_size
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array, Run, Session
from gyrocal.warning import Warning, accepted

BLOCK_S = 0.2
"""Length of blocks, s. Differences of their means give the noise at low frequencies, between a low-pass and the drift."""
LEAST_NOISE_DPS = 1e-6
TREMBLES, SHRUNK = 4.0, 10.0
"""Rests whose variance exceeds the median by the first factor do not count in the sensor's own noise. In the noise of a rest's
mean, the sensor's own noise has the weight of the second number of blocks."""


class SmallRatesError(InputError):
    """The readings turn by far less than gravity does."""


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
        """Number of samples."""
        return self.stop - self.start


@dataclass(frozen=True)
class Noise:
    """Noise at low frequencies of one sample of the sensor [3], and of the mean over each rest [rests, 3] including tremor."""

    of_sample: Array
    of_means: Array

    @staticmethod
    def of(stretches: Sequence[Array], rate_hz: float) -> Noise:
        """Noise of stretches [n, 3] at rest, from differences of neighbouring block means, which contain no bias or slow drift.

        A sensor's own noise is that of the rests with a variance up to ``TREMBLES`` times the median. The variance of each rest
        is shrunk to it with the weight of ``SHRUNK`` blocks.
        """
        size = max(2, round(BLOCK_S * rate_hz))
        sums, counts = np.zeros((len(stretches), 3)), np.zeros(len(stretches))
        for k, values in enumerate(stretches):
            blocks = values[: len(values) // size * size].reshape(-1, size, 3).mean(axis=1)
            sums[k] = np.sum(np.diff(blocks, axis=0) ** 2, axis=0) / 2 * size
            counts[k] = max(len(blocks) - 1, 0)
        known = counts > 0
        median = np.median(sums[known] / counts[known, None], axis=0) if known.any() else np.zeros(3)
        quiet = known & np.all(sums <= TREMBLES * median * counts[:, None], axis=1)
        own = sums[quiet].sum(axis=0) / max(float(counts[quiet].sum()), 1.0)
        shrunk = (sums + SHRUNK * own) / (counts + SHRUNK)[:, None]
        return Noise(np.sqrt(own), np.sqrt(shrunk / np.array([len(v) for v in stretches])[:, None]))


@dataclass(frozen=True)
class Scene:
    """``up`` [rests, 3] holds the unit vectors of gravity's reaction in the common frame."""

    session: Session = field(repr=False)
    rests: list[Rest]
    movements: list[Movement]
    chunks: list[Chunk]
    accelerometer: Accelerometer
    up: Array
    noise: Noise
    """Noise of the gyroscope, deg/s."""
    warnings: list[Warning]
    acc_white_g: Array = field(default_factory=lambda: np.zeros(3), repr=False)
    """Noise of one sample of the accelerometer at low frequencies [3], g."""

    @staticmethod
    def of(session: Session) -> Scene:
        """Find rests and movements. Raises InputError if rests are too few or accelerations are not near 1 g."""
        found = find(session)
        rate_hz = _rate_hz(session)
        gyro = _readings_at(session, found.rests)
        acc = [filled_acc_g(session.runs[r.run])[r.start : r.stop] for r in found.rests]
        gyro_noise, acc_noise = Noise.of(gyro, rate_hz), Noise.of(acc, rate_hz)
        accelerometer = calibrate(found.rests, np.sqrt(np.mean(acc_noise.of_means**2, axis=1)))
        true_g = accelerometer.true_g(np.array([r.acc_g for r in found.rests]))
        up = true_g / np.linalg.norm(true_g, axis=1)[:, None]
        chunks = [c for i, r in enumerate(found.rests) for c in _chunks(session, r, i)]
        scene = Scene(
            session, found.rests, found.movements, chunks, accelerometer, up, gyro_noise, found.warnings, acc_noise.of_sample
        )
        scene.refuse_small_rates()
        sizes = wrong_size(session, found.rests, found.movements, up, scene.turned_deg)
        scene.warnings.extend(accepted(sizes, session.accept))
        return scene

    def refuse_small_rates(self) -> None:
        """Raise SmallRatesError if the readings turn by far less than gravity, which no movement can, whatever its path."""
        part = path_of_turn(self.session, self.rests, self.movements, self.turned_deg)
        if part is not None and part < POLICY.least_path:
            raise SmallRatesError(
                f"the gyroscope turns by {part:.2g} of the angle that gravity turns between rests, and cannot turn by less "
                "than all of it. If its readings are in rad/s, give the unit when importing (--map gx_dps=COLUMN:rad/s); if "
                "they are raw counts, check the size of one count"
            )

    @property
    def accelerometer_model(self) -> AccelerometerModel:
        """The accelerometer as a model keeps it."""
        own, (matrix_se, bias_se_g) = self.accelerometer, self.accelerometer.se
        return AccelerometerModel.of(own.matrix, matrix_se, own.bias_g, bias_se_g, self.acc_white_g)

    def accelerometer_json(self) -> dict[str, Any]:
        """The accelerometer with standard errors, and the misfit of its rests: 1 where noise explains their scatter."""
        return {**self.accelerometer_model.to_json(), "misfit": self.accelerometer.misfit}

    @property
    def white_dps(self) -> Array:
        """Noise of one gyroscope sample at low frequencies, shape [3], deg/s."""
        return np.maximum(self.noise.of_sample, LEAST_NOISE_DPS)

    @property
    def turned_deg(self) -> Array:
        """The angle by which gravity's direction turns in each movement, shape [movements], deg."""
        before, after = [m.before for m in self.movements], [m.after for m in self.movements]
        cosine = np.sum(self.up[before] * self.up[after], axis=1)
        return np.asarray(np.rad2deg(np.arccos(np.clip(cosine, -1.0, 1.0))))

    @cached_property
    def turning(self) -> list[Run]:
        """Each run turning about each of its axes at about its true rate, for the question whether an effect can be seen."""
        return [turning_about(r, axis, r.gyro_dps) for r in self.session.runs for axis in AXES]

    @property
    def cycles(self) -> list[str]:
        """Names of the power cycles."""
        return self.session.scenarios


def _rate_hz(session: Session) -> float:
    return float(np.mean([(len(r) - 1) / float(r.sample_s[-1] - r.sample_s[0]) for r in session.runs]))


def _readings_at(session: Session, rests: Sequence[Rest]) -> list[Array]:
    """The readings [n, 3] of each rest, deg/s."""
    return [session.runs[r.run].gyro_dps[r.start : r.stop] for r in rests]


def _chunks(session: Session, rest: Rest, number: int) -> list[Chunk]:
    parts = max(1, round(rest.seconds / CHUNK_S))
    edges = np.linspace(rest.start, rest.stop, parts + 1).astype(int)
    t_s = session.runs[rest.run].sample_s
    return [
        Chunk(rest.run, int(a), int(b), float(t_s[a:b].mean()), number) for a, b in pairwise(edges)
    ]
