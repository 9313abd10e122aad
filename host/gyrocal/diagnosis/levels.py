"""rms, noise floor and excess of held-out residuals."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gyrocal.diagnosis.finding import Finding
from gyrocal.diagnosis.probes import beside
from gyrocal.effects.dead_band import outliers_of
from gyrocal.inference import heldout
from gyrocal.inference.blocks import begins_apart
from gyrocal.inference.fitted import Fit
from gyrocal.inference.heldout import Prediction
from gyrocal.inference.noise_search import LEAST_WHITE_DPS
from gyrocal.noise.spectrum import Spectrum
from gyrocal.policy import POLICY
from gyrocal.recording.first_readings import FIRST
from gyrocal.recording.session import AXES, Array


@dataclass(frozen=True)
class Level:
    """rms of held-out residuals, noise floor and excess, in deg/s; rms and excess are None if nothing can be held out."""

    rms_dps: float | None
    floor_dps: float
    excess_dps: float | None

    def to_json(self) -> dict[str, Any]:
        return {"rms_dps": self.rms_dps, "floor_dps": self.floor_dps, "excess_dps": self.excess_dps}


def level_of(squares: Array, floor: float) -> Level:
    """The level computed from sums of squares and counts [axes, 2] of :func:`squares_of` and a floor in deg/s."""
    total, samples = squares.sum(axis=0)
    if samples == 0:
        return Level(None, floor, None)
    rms = float(np.sqrt(total / samples))
    return Level(rms, floor, float(np.sqrt(max(0.0, rms**2 - floor**2))))


def squares_of(held: Iterable[Prediction]) -> Array:
    """The sum of squared residuals (dps^2) and the number of samples of each axis, shape [3, 2]."""
    out = np.zeros((len(AXES), 2))
    for p in held:
        out[p.axis] += float(np.sum(p.residual_dps**2)), p.modelled_dps.size
    return out


def floor_dps(fitted: Fit, axis: str, where: Sequence[Finding], white_power: float) -> float:
    """The rms that white noise, quantisation, drift and turn-on bias predict, deg/s.

    Where probes found a misfit, drift and turn-on bias are those of the fit that contains the probes' shapes. Otherwise they
    would absorb the misfit.
    """
    current = fitted.axes[axis]
    shapes = [f.shape for f in where if f.axis == axis and f.shape is not None]
    if shapes:
        current = beside(current, axis, shapes)
    return float(np.sqrt(white_power + current.slow_power))


def residuals(fitted: Fit, axis: str) -> dict[int, Array]:
    """In-sample residuals of each run [n] by file, deg/s. Outliers are moved back to their neighbours."""
    out = {}
    for p in heldout.fitted(fitted.on(axis)):
        residual = p.residual_dps
        residual[:FIRST] -= begins_apart(p.run, p.axis, residual)
        rows, apart_dps = outliers_of(p.run, p.axis, residual)
        residual[rows] -= apart_dps
        out[p.run.index] = residual
    return out


def white_power(fitted: Fit, axis: str, by_run: dict[int, Array], spectrum: Spectrum) -> float:
    """Mean square of the noise of one sample, dps^2: the scatter of residuals within blocks, without spectral lines."""
    total, count = 0.0, 0
    for b in fitted.blocks:
        if b.run.index not in by_run or b.within_n == 0:
            continue
        grouped = by_run[b.run.index][b.start[:, None] + np.arange(int(b.n[0]))]
        total += float(((grouped - grouped.mean(axis=1, keepdims=True)) ** 2).sum())
        count += b.within_n
    if count < POLICY.least_scatter:  # each block is one sample: use the white level of the fit
        return fitted.axes[axis].noise.white_sd_dps ** 2
    return max(total / count - spectrum.line_power(POLICY.floor_line_chance), LEAST_WHITE_DPS**2)
