"""What is true of recordings by others, by least squares and spectra in numpy alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyrocal.recording.session import Array


def swing_fit(t_s: Array, angle_deg: Array, reading_dps: Array) -> tuple[float, float, float]:
    """Scale error, bias (dps) and delay (s) by least squares of the integrated reading on the encoder's angle."""
    turned = np.concatenate([[0.0], np.cumsum(np.diff(t_s) * (reading_dps[1:] + reading_dps[:-1]) / 2)])
    best = (np.inf, 0.0, 0.0, 0.0)
    for lag_s in np.arange(0.0, 0.04, 0.001):
        shifted = np.interp(t_s - lag_s, t_s, angle_deg)
        columns = np.column_stack([shifted, t_s, np.ones_like(t_s)])
        solved, *_ = np.linalg.lstsq(columns, turned, rcond=None)
        rms = float(np.std(turned - columns @ solved))
        if rms < best[0]:
            best = (rms, float(solved[0] - 1), float(solved[1]), float(lag_s))
    return best[1:]


@dataclass(frozen=True)
class Map:
    """Readings of three axes from a reference's rates: ``reading(t) = matrix @ rate(t - offset_s) + bias_dps``."""

    offset_s: float
    matrix: Array
    bias_dps: Array

    @property
    def symmetric(self) -> Array:
        """The symmetric factor [3, 3] of the matrix, which is this factor times a rotation."""
        values, vectors = np.linalg.eigh(self.matrix @ self.matrix.T)
        return np.asarray((vectors * np.sqrt(values)) @ vectors.T)

    @property
    def rotation(self) -> Array:
        """The rotation [3, 3] from the reference's frame to the sensor's."""
        return np.asarray(np.linalg.inv(self.symmetric) @ self.matrix)

    @property
    def scales(self) -> Array:
        """Scale errors [3]."""
        return np.asarray(np.diag(self.symmetric) - 1)


def means(t_s: Array, values: Array, known: Array) -> Array:
    """Means [m, k] of ``values`` [n, k] over 0.1 s, without those near which ``known`` [n] is false."""
    size = round(0.1 / float(np.median(np.diff(t_s))))
    count = len(t_s) // size * size
    whole = np.convolve(~known, np.ones(2 * size + 1), "same")[:count].reshape(-1, size).max(axis=1) < 0.5
    return np.asarray(values[:count].reshape(-1, size, values.shape[1]).mean(axis=1)[whole])


def map_fit(t_s: Array, gyro_dps: Array, ref_dps: Array) -> Map:
    """The map from the reference's rates to the readings, by least squares on means over 0.1 s."""
    known = np.isfinite(ref_dps).all(axis=1)
    readings = means(t_s, gyro_dps, known)
    best = (np.inf, Map(0.0, np.eye(3), np.zeros(3)))
    for offset_s in np.arange(0.0, 0.009, 0.00025):
        shifted = np.column_stack([np.interp(t_s - offset_s, t_s[known], ref_dps[known, i]) for i in range(3)])
        columns = np.column_stack([means(t_s, shifted, known), np.ones(len(readings))])
        solved, squares, *_ = np.linalg.lstsq(columns, readings, rcond=None)
        if squares.sum() < best[0]:
            best = (float(squares.sum()), Map(float(offset_s), solved[:3].T, solved[3]))
    return best[1]


def body_rate_dps(quaternion: Array, rate_hz: float) -> Array:
    """Body rate [n, 3] in deg/s from unit quaternions [n, 4] (w, x, y, z; body to fixed), by symmetric differences."""
    q = quaternion.copy()
    flips = np.cumprod(np.where(np.nansum(q[1:] * q[:-1], axis=1) < 0, -1.0, 1.0))
    q[1:] *= flips[:, None]
    rate = np.full((len(q), 3), np.nan)
    a, b = q[:-2], q[2:]
    w = a[:, 0] * b[:, 0] + np.sum(a[:, 1:] * b[:, 1:], axis=1)
    v = a[:, :1] * b[:, 1:] - b[:, :1] * a[:, 1:] - np.cross(a[:, 1:], b[:, 1:])
    size = np.linalg.norm(v, axis=1)
    angle = 2 * np.arctan2(size, w)
    rate[1:-1] = np.rad2deg(v / np.maximum(size, 1e-12)[:, None] * angle[:, None]) * rate_hz / 2
    return rate


def lines_hz(reading: Array, rate_hz: float, chance: float = 1e-3) -> list[float]:
    """Frequencies from 1 Hz on whose power over the median around them noise reaches with a probability below ``chance``.

    The periodogram is that of the whole recording with a Hann window. Of neighbours within 0.1 Hz the strongest counts.
    """
    power = np.abs(np.fft.rfft((reading - reading.mean()) * np.hanning(reading.size))) ** 2
    frequency = np.fft.rfftfreq(reading.size, 1 / rate_hz)
    around = np.lib.stride_tricks.sliding_window_view(np.pad(power, 200, mode="reflect"), 401)
    ratio = np.where(frequency > 1.0, power / (np.median(around, axis=1) / np.log(2)), 0.0)
    lines: list[float] = []
    for k in np.argsort(-ratio):
        if ratio[k] < np.log(power.size / chance):
            break
        if all(abs(frequency[k] - f) > 0.1 for f in lines):
            lines.append(float(frequency[k]))
    return sorted(lines)
