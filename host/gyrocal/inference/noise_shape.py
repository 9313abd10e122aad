"""Noise that is not the same in all blocks, or not independent from block to block: levels that change, and colour.

Both are taken from the residuals of a first fit, and kept where the likelihood of the session rises.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gyrocal.inference.blocks import known_dps
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.noise_search import fit_noise, with_noise
from gyrocal.noise.steady import relative_levels
from gyrocal.policy import POLICY
from gyrocal.recording.outliers import outliers
from gyrocal.recording.session import Array

COLORS = np.linspace(-0.8, 0.7, 151)
LOWEST_HZ = 1.0
"""Frequency above which block means show the colour of the fast noise. Below it are drift and effects of a turning table."""
BANDS = 8
LEAST_IN_BAND = 12
"""Bands, each with so many values of the periodogram at the least, whose medians are compared. A median ignores lines."""


def shaped(current: AxisFit) -> AxisFit:
    """The fit with the level of the noise in each block, and its colour, as the residuals show them."""
    weighted = _weighted(current)
    if weighted is not None:
        current = _better(current, weighted)
    color = _color(current)
    return _better(current, _refitted(current, color)) if color else current


def _better(current: AxisFit, trial: AxisFit) -> AxisFit:
    return trial if trial.loglik > current.loglik + POLICY.noise_shape_gain else current


def _refitted(current: AxisFit, color: float) -> AxisFit:
    design = current.design.colored(color)
    return fit_noise(design, start=with_noise(design, current.noise, current.spreads))


def _weighted(current: AxisFit) -> AxisFit | None:
    """The fit with blocks weighted by the level of the noise at their time; None if the level does not change."""
    design, axis = current.design, current.design.axis
    residuals = []
    for b in design.blocks:
        y_dps = b.run.gyro_dps[:, axis] - known_dps(b.run, axis)
        rows, apart_dps = outliers(y_dps, b.run.step_dps[axis])
        y_dps[rows] -= apart_dps
        residuals.append(y_dps)
    levels = relative_levels(residuals)
    if levels.of_residual is None:
        return None
    power = [b.mean(level[:, None] ** 2)[:, 0] for b, level in zip(design.blocks, levels.of_residual, strict=True)]
    usual = float(np.mean(np.concatenate(power)))
    blocks = [replace(b, weight=usual / p) for b, p in zip(design.blocks, power, strict=True)]
    heavier = design.over(blocks)
    return fit_noise(heavier, start=with_noise(heavier, current.noise, current.spreads))


def _color(current: AxisFit) -> float:
    """Correlation of the white noise of neighbouring blocks; 0 if they are too few to show one.

    The autoregression whose spectrum is parallel to the periodogram of the residuals above ``LOWEST_HZ``.
    """
    angles: list[Array] = []
    powers: list[Array] = []
    for i, b in enumerate(current.design.blocks):
        m = b.t_s.size
        if m < 2 * BANDS or np.ptp(b.n) > 0 or b.run.rate_is_mean:
            continue
        step_s = float(b.t_s[-1] - b.t_s[0]) / (m - 1)
        residual = current.block_residuals(i) * np.sqrt(b.precision)
        power = np.abs(np.fft.rfft((residual - residual.mean()) * np.hanning(m))) ** 2 / m
        angle = 2 * np.pi * np.fft.rfftfreq(m)
        fast = (angle > 2 * np.pi * LOWEST_HZ * step_s) & (angle < 0.98 * np.pi)
        angles.append(angle[fast].astype(np.float64))
        powers.append(power[fast].astype(np.float64))
    angle = np.concatenate([*angles, np.zeros(0)])
    if angle.size < BANDS * LEAST_IN_BAND:
        return 0.0
    order = np.argsort(angle)
    bands = np.array_split(order, BANDS)
    power = np.maximum(np.concatenate(powers), np.finfo(np.float64).tiny)
    level = np.array([np.log(np.median(power[band])) for band in bands])
    middle = np.array([float(np.mean(np.cos(angle[band]))) for band in bands])
    off = level[:, None] + np.log(1 + COLORS**2 - 2 * COLORS * middle[:, None])
    color = float(COLORS[int(np.argmin(off.var(axis=0)))])
    return color if abs(color) > POLICY.color_errors / np.sqrt(2 * angle.size) else 0.0
