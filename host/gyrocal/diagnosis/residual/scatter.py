"""Noise whose level changes: how much larger block means are than a fit expects that weighs noisy stretches less.

The fit estimates the noise from block means without outliers, in which noisy blocks have little weight. The floor is the noise
of all readings. Within blocks, their own scatter tells it. For the block means, the scatter within them is scaled by the ratio
of both, which is that of the sensor's low-pass. The ratio is taken from second differences of the means, which no slow error
changes, weighted by the scatter of the neighbours, so that a burst counts little and biases nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gyrocal.inference.fitted import AxisFit
from gyrocal.recording.session import Array

NEIGHBOURS = np.concatenate([np.ones(5), np.zeros(3), np.ones(5)]) / 10
"""The blocks whose scatter is the level at the middle one: those near it, but none of its second difference."""
LEAST_LEVEL = 0.1
"""Least level, as a part of the usual one, that a second difference is weighted by."""


@dataclass(frozen=True)
class Scatter:
    """The noise of one axis as its readings scatter within blocks, which needs no model of the noise.

    ``power`` is the mean square of a reading's noise, dps^2. Where the level of the noise changes, the mean square of all
    block means is ``uneven`` times as large as the fit expects of white noise. ``peaked`` is the mean square of the noise's
    power in a block, over the square of its mean: 1 for a constant level.
    """

    power: float
    uneven: float = 1.0
    peaked: float = 1.0

    def noise_of(self, axis: AxisFit) -> AxisFit:
        """A fit with the white noise of all readings."""
        if self.uneven == 1.0:
            return axis
        noise = axis.noise
        return replace(axis, noise=replace(noise, white_sd_dps=float(np.sqrt(self.uneven)) * noise.white_sd_dps))

    def error(self, blocks: int) -> float:
        """Standard error of a sum of squares of block means over its floor, in units of their white noise's square.

        The scatter of the means of noisy stretches is not that of the others, to which the noise was fitted.
        """
        return float(np.sqrt(2 * blocks * (self.peaked - 1)))


@dataclass(frozen=True)
class BlocksOfRun:
    """The blocks of a run: sums of squares [m] of its readings within blocks, with and means [m] with and without outliers,
    and the weight [m] of a block in the fit.
    """

    squares: Array
    means: Array
    clean_means: Array
    weight: Array

    @staticmethod
    def of(noisy: Array, clean: Array | None, weight: Array) -> BlocksOfRun:
        """From residuals [m, n] with and without outliers; ``clean`` is None if there are none."""
        means = noisy.mean(axis=1)
        clean_means = means if clean is None else clean.mean(axis=1)
        return BlocksOfRun(((noisy - means[:, None]) ** 2).sum(axis=1), means, clean_means, weight)

    @property
    def changes(self) -> bool:
        """True if the fit weighs blocks differently, or lacks outliers that are noise."""
        return bool(np.ptp(self.weight) > 0 or np.any(self.means != self.clean_means))


def unevenness(runs: Sequence[BlocksOfRun], degrees: int) -> tuple[float, float]:
    """``uneven`` and ``peaked`` of :class:`Scatter`, whose blocks have ``degrees`` of freedom altogether."""
    longer = [run for run in runs if run.means.size > NEIGHBOURS.size]
    if not any(run.changes for run in longer):
        return 1.0, 1.0
    levels = [np.convolve(run.squares, NEIGHBOURS, mode="same") for run in longer]
    usual = float(np.median(np.concatenate(levels)))
    if usual == 0.0:  # most readings stand at one count
        return 1.0, 1.0
    of_means = of_squares = of_fit = 0.0
    for run, level in zip(longer, levels, strict=True):
        weight = 1 / np.maximum(level[1:-1], LEAST_LEVEL * usual)
        of_means += float(_second(run.means) ** 2 @ weight)
        of_squares += float((run.squares[2:] / 4 + run.squares[1:-1] + run.squares[:-2] / 4) / 1.5 @ weight)
        of_fit += float(_second(run.clean_means) ** 2 @ run.weight[1:-1])
    squares, weights = np.concatenate([run.squares for run in runs]), np.concatenate([run.weight for run in runs])
    count = sum(run.means.size - 2 for run in longer)
    if not of_squares > 0 or not of_fit > 0:
        return 1.0, 1.0
    mean = float(squares.mean())
    uneven = mean * of_means / of_squares / (of_fit / count) / float(np.mean(1 / weights))
    alike = 1 + 2 * squares.size / degrees
    return uneven, max(1.0, float(np.mean(squares**2)) / mean**2 / alike)


def _second(means: Array) -> Array:
    """Second differences [m - 2] of means [m], of the variance of 1.5 means."""
    return np.asarray(means[1:-1] - (means[:-2] + means[2:]) / 2)
