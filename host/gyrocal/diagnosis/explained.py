"""The part of the excess error that a candidate explains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyrocal.diagnosis.current import Current
from gyrocal.inference.fitted import AxisFit
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array


@dataclass(frozen=True)
class Explained:
    """``part`` is 1 - (excess after / excess before)^2, or None without an excess; ``enough`` is True if it is sufficient."""

    part: float | None
    enough: bool


def explained(current: Current, fitted: AxisFit, signal: Array) -> Explained:
    """The part of the excess on this axis that a candidate removes, on held-out data and over the richer model's floor.

    A few power cycles determine the spread of their offsets poorly. The floor therefore has a standard error, and the offset
    of a held-out power cycle can change the excess by more than a small effect does. ``enough`` allows for both. It is True
    if the candidate's own power, or the decrease of the excess, is at least ``Policy.explained`` of the excess beyond
    ``Policy.floor_errors`` standard errors of the floor. It is also True if the candidate's power reaches that part within
    power cycles, where their offsets are removed from both.
    """
    if not current.folds:
        return Explained(None, False)
    before, after = current.mean_squares.all, current.mean_squares_of(fitted)
    white, drift = current.white_power, fitted.noise.ou_sd_dps**2
    floor = white + fitted.slow_power
    samples = sum(len(b.run) for b in fitted.design.blocks)
    of_cycles, of_drift = _floor_errors(fitted)
    sure = floor + POLICY.floor_errors * float(np.hypot(of_cycles, of_drift))
    sure_within = white + drift + POLICY.floor_errors * float(np.hypot(white * np.sqrt(2 / samples), of_drift))
    enough = before - after.all >= POLICY.explained * max(before - sure, 0.0) and before > after.all
    for power, left in (
        (float(signal @ signal), after.all - sure),
        (_within_cycles(fitted, signal), after.within_cycles - sure_within),
    ):
        power /= samples
        enough = enough or (power >= POLICY.explained * (power + max(left, 0.0)) and power > 0)
    if before <= floor:
        return Explained(None, enough)
    return Explained(float(1 - max(0.0, after.all - floor) / (before - floor)), enough)


def _within_cycles(fitted: AxisFit, signal: Array) -> float:
    """Sum of squares (dps^2) of a signal [blocks], as ``evidence`` computes it, about its mean in each power cycle."""
    if not signal.size:  # a fault of the reading has no signal
        return 0.0
    weight = np.sqrt(np.concatenate([b.n for b in fitted.design.blocks]))
    cycle = np.repeat(np.unique(fitted.design.scenarios, return_inverse=True)[1], fitted.design.n_blocks)
    mean = np.bincount(cycle, signal * weight) / np.bincount(cycle, weight**2)
    return float(np.sum((signal - mean[cycle] * weight) ** 2))


def _floor_errors(fitted: AxisFit) -> tuple[float, float]:
    """Standard error of the squared floor, dps^2, from the number of power cycles and of correlation times of the drift."""
    cycles = len(np.unique(fitted.design.scenarios))
    seconds = sum(b.run.duration_s for b in fitted.design.blocks)
    turns = len(fitted.design.blocks) + seconds / (2 * fitted.noise.ou_tau_s)
    drift = fitted.noise.ou_sd_dps**2
    return float((fitted.slow_power - drift) * np.sqrt(2 / cycles)), float(drift * np.sqrt(2 / turns))
