"""The part of the excess error that a candidate explains."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gyrocal.diagnosis.naming.standing_model import Current
from gyrocal.diagnosis.residual.levels import Floor, Level, MeanSquares, excess_of
from gyrocal.diagnosis.residual.levels import explained as part_of
from gyrocal.inference.fitted import AxisFit
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array


@dataclass(frozen=True)
class Explained:
    """What a candidate makes of the excess on its axis.

    ``part`` is 1 - (excess after / excess before)^2, or None without a certain excess; ``enough`` is True if it is sufficient.
    ``drop_dps`` is excess before minus excess after, with its standard error; both are None if nothing can be held out.
    """

    part: float | None
    enough: bool
    drop_dps: float | None = None
    drop_se_dps: float | None = None


def explained(current: Current, fitted: AxisFit, signal: Array, chance: float) -> Explained:
    """The part of the excess on this axis that a candidate removes, on held-out data and over the richer model's floor.

    A few power cycles determine the spread of their offsets poorly, and the offset of a held-out power cycle can change the
    excess by more than a small effect does. ``enough`` allows for both. It is True if the candidate's own power, or the
    decrease of the excess, is at least ``Policy.explained`` of the excess beyond ``Policy.floor_errors`` standard errors of the
    floor. It is also True if the candidate's power reaches that part within power cycles, where their offset and scale are
    removed from both. A candidate that noise explains, with a probability ``chance`` above the false-discovery rate, leaves the
    noise and its floor as they are. A slow effect is held against the excess of block means.
    """
    if not current.folds:
        return Explained(None, False)
    before, after = current.squares, current.squares_of(fitted)
    significant = chance < POLICY.false_discovery_rate
    known = current.comparison.floors[current.axis]
    floor = current.floor_of(fitted) if significant else known
    if fitted.design.n_blocks.sum() > current.comparison.fit.axes[current.axis].design.n_blocks.sum():
        # the noise of a fit to samples holds the lines that the candidate leaves
        floor = replace(floor, all=min(floor.all, known.all), within=min(floor.within, known.within))
    if not any(t.effect.fast or t.effect.fault_of(t.values) for t in fitted.terms[len(current.fit.terms) :]):
        before, after = _slow_part(before, floor), _slow_part(after, floor)
    part = part_of(Level.of(before, floor), Level.of(after, floor), current.comparison.cycles)
    samples = sum(len(b.run) for b in fitted.design.blocks)
    of_cycles, of_drift = _floor_errors(fitted, floor)
    sure = floor.all + POLICY.floor_errors * float(np.hypot(of_cycles, of_drift))
    white_error = floor.white * np.sqrt(2 / samples)
    sure_within = floor.within + POLICY.floor_errors * float(np.hypot(white_error, of_drift))
    enough = before.all - after.all >= POLICY.explained * max(before.all - sure, 0.0) and before.all > after.all
    for power, left in (
        (float(signal @ signal), after.all - sure),
        (_within_cycles(fitted, signal), after.within - sure_within),
    ):
        power /= samples
        enough = enough or (power >= POLICY.explained * (power + max(left, 0.0)) and power > 0)
    return Explained(part, enough, *_drop(before, after, floor))


def _slow_part(squares: MeanSquares, floor: Floor) -> MeanSquares:
    """The mean squares without the excess within blocks of 0.1 s, of which a slow effect can explain nothing.

    It is fitted to block means. Its columns may even be wrong within blocks: those of a rectified vibration have a line at
    twice the motor's frequency, which the sensor's low-pass weakens and delays.
    """
    fast = max(0.0, squares.fast - floor.fast)
    return replace(squares, all=squares.all - fast, within=max(0.0, squares.within - fast), fast=squares.fast - fast)


def _drop(before: MeanSquares, after: MeanSquares, floor: Floor) -> tuple[float, float]:
    """Excess before minus excess after with its standard error, deg/s.

    The noise of both is the same, so only its correlation with the part that is removed remains in the error: that of white
    noise, and that of drift and offsets with the residual before.
    """
    white = floor.white / max(before.samples, 1)
    old, new = (excess_of(s.all - floor.all, 0.0, 0.0)[0] for s in (before, after))
    removed = abs(before.all - after.all)
    return old - new, excess_of(removed, before.error, white)[1]


def _within_cycles(fitted: AxisFit, signal: Array) -> float:
    """Sum of squares (dps^2) of a signal [blocks], as ``evidence`` computes it, about its mean in each power cycle."""
    if not signal.size:  # a fault of the reading has no signal
        return 0.0
    weight = np.sqrt(np.concatenate([b.n for b in fitted.design.blocks]))
    cycle = np.repeat(np.unique(fitted.design.scenarios, return_inverse=True)[1], fitted.design.n_blocks)
    mean = np.bincount(cycle, signal * weight) / np.maximum(np.bincount(cycle, weight**2), np.finfo(np.float64).tiny)
    return float(np.sum((signal - mean[cycle] * weight) ** 2))


def _floor_errors(fitted: AxisFit, floor: Floor) -> tuple[float, float]:
    """Standard error of the squared floor, dps^2, from the number of power cycles and of correlation times of the drift."""
    cycles = len(np.unique(fitted.design.scenarios))
    seconds = sum(b.run.duration_s for b in fitted.design.blocks)
    turns = len(fitted.design.blocks) + seconds / (2 * fitted.noise.ou_tau_s)
    of_cycles, of_drift = floor.all - floor.within, max(0.0, floor.within - floor.white)
    return float(of_cycles * np.sqrt(2 / cycles)), float(of_drift * np.sqrt(2 / turns))
