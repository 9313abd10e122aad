"""The colour of fast noise: block means whose white noise is correlated from block to block, and the filter that undoes it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gyrocal.recording.session import Array

Mask = np.ndarray[Any, np.dtype[np.bool_]]


MOST_ALIKE = 0.7
"""Largest correlation of neighbouring blocks that a colour describes."""


@dataclass(frozen=True)
class Color:
    """``neighbours`` is the correlation of neighbouring blocks that a low-pass filter causes (autoregression).

    ``of_angle`` is the noise of an angle at the ends of each block: the reference is the difference of both over the block's
    length, and neighbouring blocks share an end with opposite signs. It is a variance over that of the block's white noise.
    Slow columns and the drift pass the filter as they are, so the white level is the density of the noise at low frequencies.
    """

    neighbours: float = 0.0
    of_angle: float = 0.0

    def __bool__(self) -> bool:
        return self != WHITE

    @property
    def level(self) -> float:
        """The variance of a block over that of white noise with the same density at low frequencies."""
        return (1 - self.neighbours) / (1 + self.neighbours) + 2 * self.of_angle

    def density(self, angle: Array) -> Array:
        """The spectral density of block means over that at low frequencies, at angles [k] per block, rad."""
        neighbours = (1 - self.neighbours) ** 2 / np.abs(1 - self.neighbours * np.exp(-1j * angle)) ** 2
        return np.asarray(neighbours + 2 * self.of_angle * (1 - np.cos(angle)))

    def whitened(self, columns: Array, joined: Mask) -> Array:
        """Columns [q, m] with the noise white; ``joined`` [m - 1] is False between blocks with a gap, where it starts again."""
        if self.of_angle:
            below, pivots = self._factors(joined)
            return np.asarray(_solved(below, columns) / np.sqrt(pivots))
        color = self.neighbours
        out = np.empty_like(columns)
        out[:, 0] = columns[:, 0] * self._starting
        filtered = (columns[:, 1:] - color * columns[:, :-1]) / (1 - color)
        out[:, 1:] = np.where(joined, filtered, columns[:, 1:] * self._starting)
        return out

    def log_determinant(self, joined: Mask) -> float:
        """Twice the logarithm of the determinant of the filter in :meth:`whitened`, with its ``joined`` [m - 1]."""
        if self.of_angle:
            return -float(np.log(self._factors(joined)[1]).sum())
        together = int(np.count_nonzero(joined))
        return 2 * float(
            (joined.size + 1 - together) * np.log(self._starting) - together * np.log(1 - self.neighbours)
        )

    @property
    def _starting(self) -> float:
        return float(np.sqrt((1 + self.neighbours) / (1 - self.neighbours)))

    def _factors(self, joined: Mask) -> tuple[Array, Array]:
        """``L D L'`` of the tridiagonal covariance of blocks whose ends have noise: L's elements [m - 1], and D [m]."""
        from scipy.linalg.lapack import dpttrf

        diagonal = np.full(joined.size + 1, 1 + 2 * self.of_angle)
        pivots, below, _ = dpttrf(diagonal, np.where(joined, -self.of_angle, 0.0))
        return below, pivots


WHITE = Color()


def _solved(below: Array, columns: Array) -> Array:
    """``L^-1 c`` for columns c [q, m] and a unit lower bidiagonal L."""
    from scipy.linalg import solve_banded

    bands = np.vstack([np.ones(below.size + 1), np.append(below, 0.0)])
    return np.asarray(solve_banded((1, 0), bands, columns.T).T)
