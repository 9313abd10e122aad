"""Noise whose level changes: the level of each short window of a recording, shrunk to the common one.

Windows of equal noise differ only as a chi-square variable does. What they differ by beyond that is a change of the level
(empirical Bayes; Efron and Morris, J. Am. Stat. Assoc. 68 (1973) 117).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from gyrocal.recording.session import Array

Index = np.ndarray[Any, np.dtype[np.intp]]

WINDOW = 64
"""Samples of a window. Interference of a second and less is seen at 100 Hz, and a window still knows its level to a tenth."""
LEAST_WINDOWS = 6
ENOUGH = 1 << 13
"""Samples of a recording that show its autocorrelation."""
LEAST_POWER = 1e-4
"""Least power of a window over the mean. Noise that grows with the rate makes rests quieter than turns by a factor of 500."""
LEAST_STILL, STANDS_STILL = 0.01, 0.5
"""The same of a window in which more than a part of the readings repeat the one before, which shows no noise."""
SURE = 4.0
"""Standard errors by which windows must differ more than equal ones do."""


def shrunk(values: Array, variance: float) -> Array:
    """Values [k] about zero, each known with the same ``variance``, shrunk by what they do not differ beyond it."""
    k = values.size
    if k < 2:
        return np.zeros_like(values)
    scatter = float(values @ values) / (k - 1)
    beyond = scatter - variance
    if beyond < SURE * variance * float(np.sqrt(2 / (k - 1))):
        return np.zeros_like(values)
    return values * beyond / scatter


def as_many(powers: Array) -> float:
    """The number of equally noisy periodograms whose mean scatters as that of periodograms of these powers [k] does."""
    return float(powers.sum() ** 2 / max(float(powers @ powers), 1e-300))


@dataclass(frozen=True)
class Levels:
    """Relative level of the noise at every sample of each residual [n]; None if it does not change."""

    of_residual: tuple[Array, ...] | None

    @property
    def change(self) -> bool:
        """True if the level of the noise changes."""
        return self.of_residual is not None

    def steadied(self, residuals: Sequence[Array]) -> Sequence[Array]:
        """The residuals [n] of each run, each sample divided by the relative level at its time."""
        if self.of_residual is None:
            return residuals
        return [r / level for r, level in zip(residuals, self.of_residual, strict=True)]


def relative_levels(residuals: Sequence[Array], window: int = WINDOW, count_dps: float = 0.0) -> Levels:
    """The relative level of the noise of residuals [n] over time, from the differences of neighbours in windows.

    Its geometric mean is one. Readings that stand still have at least the variance ``count_dps**2 / 12`` of rounding.
    """
    counts = [max(0, (r.size - 1) // window) for r in residuals]
    if sum(counts) < LEAST_WINDOWS:
        return Levels(None)
    squares = [np.diff(r)[: c * window].reshape(c, window) ** 2 for r, c in zip(residuals, counts, strict=True)]
    power = np.concatenate([s.mean(axis=1) for s in squares])
    if not power.any():
        return Levels(None)
    still = np.concatenate([np.mean(s == 0, axis=1) for s in squares]) > STANDS_STILL
    least = np.where(still, LEAST_STILL, LEAST_POWER) * float(power.mean())
    log_power = np.log(np.maximum(power, np.maximum(least, count_dps**2 / 6)))
    known = _variance(residuals, window)
    own = _of_windows(log_power, np.repeat(np.arange(len(counts)), counts), known)
    if not own.any():
        return Levels(None)
    out, first = [], 0
    for r, c in zip(residuals, counts, strict=True):
        centre = (np.arange(c) + 0.5) * window
        level = np.interp(np.arange(r.size), centre, np.exp(own[first : first + c] / 2)) if c else np.ones(r.size)
        out.append(level)
        first += c
    return Levels(tuple(out))


def _of_windows(log_power: Array, run: Index, variance: float) -> Array:
    """The logarithm [k] of each window's power over the common one: that of its ``run`` [k], and what it has beside it.

    A run of constant noise knows its level better than a window does.
    """
    counts = np.bincount(run)[run]
    of_run = np.bincount(run, log_power)[run] / counts
    first = np.flatnonzero(np.diff(run, prepend=-1))
    levels = shrunk(of_run[first] - of_run[first].mean(), variance * float(np.mean(1 / counts[first])))
    own = np.repeat(levels, counts[first]) + shrunk(log_power - of_run, variance)
    return np.asarray(own - own.mean())


def _variance(residuals: Sequence[Array], window: int) -> float:
    """Variance of the logarithm of a window's mean square of differences, if the noise is Gaussian and its level constant.

    It is ``2 / window * sum of rho^2`` with the autocorrelation rho of the differences, which a low-pass filter lengthens.
    """
    lags = range(window // 2)
    long = [d for d in (np.diff(r[:ENOUGH]) for r in residuals) if d.size > 2 * window]
    square = sum((sliding_window_view(np.append(d, np.zeros(len(lags) - 1)), d.size) @ d for d in long), np.zeros(len(lags)))
    rho = square / max(square[0], 1e-300) if long else np.eye(1, square.size)[0]
    return float(2 / window * (1 + 2 * float(rho[1:] @ rho[1:])))
