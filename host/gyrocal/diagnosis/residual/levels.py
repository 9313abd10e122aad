"""rms, noise floor and excess of held-out residuals: the one place where they are computed.

The floor is the rms that noise alone is expected to leave. Its square is a sum: the scatter within blocks of 0.1 s, which needs
no model of the noise, and the expected square of the block means, which :mod:`gyrocal.inference.expected` computes from the
fitted noise. The excess is ``sqrt(max(0, rms^2 - floor^2))``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.diagnosis.residual.probes import beside, with_curves
from gyrocal.diagnosis.residual.reading_tests import single_readings
from gyrocal.diagnosis.residual.scatter import BlocksOfRun, Scatter, unevenness
from gyrocal.effects.base import Role
from gyrocal.effects.dead_band import outliers_of
from gyrocal.inference import heldout
from gyrocal.inference.blocks import BLOCK_S, begins_apart, ends_apart
from gyrocal.inference.excess_error import difference_errors
from gyrocal.inference.expected import expected, of_cycle, removed
from gyrocal.inference.fitted import AxisFit, Fit
from gyrocal.inference.heldout import Fold, Prediction
from gyrocal.inference.noise_search import LEAST_WHITE_DPS
from gyrocal.inference.noise_shape import beyond_color, less_than_color, of_slopes
from gyrocal.inference.reml import LARGEST_SPREAD
from gyrocal.inference.walk import Walks
from gyrocal.noise.spectrum import Spectrum, evenly_spaced, spectrum
from gyrocal.policy import POLICY
from gyrocal.recording.first_readings import FIRST
from gyrocal.recording.session import AXES, Array

BEYOND_ROUNDING = 1 + 1e-9
"""An excess that is three of its errors is no more than three of them after rounding."""


@dataclass(frozen=True)
class MeanSquares:
    """Mean squares of held-out residuals, dps^2: of all, and with offset and scale of each power cycle removed.

    ``fast`` is the part of both that lies within blocks of 0.1 s. ``error`` and ``error_within`` are the standard errors that a
    systematic residual adds to them: its product with the drift and with the offsets of power cycles.
    """

    all: float
    within: float
    samples: int
    fast: float = 0.0
    error: float = 0.0
    error_within: float = 0.0

    @staticmethod
    def of(held: Iterable[Prediction]) -> MeanSquares:
        """The mean squares of the predictions of one axis. Without predictions, and where the samples of a fold's training do
        not determine the model, they are zero, and ``samples`` is 0.
        """
        squares, fast, samples = 0.0, 0.0, 0
        sums: dict[str, Array] = {}
        norms: dict[str, Array] = {}
        for p in held:
            rate = p.run.rate_dps[p.rows] if p.axis == p.run.axis_index else np.zeros(p.modelled_dps.size)
            columns, residual, cycle = of_cycle(rate), p.residual_dps, p.run.scenario
            if p.rows.start == 0:
                residual[:FIRST] -= begins_apart(p.run, p.axis, residual)
            if p.rows.stop == len(p.run):
                residual[-FIRST:] -= ends_apart(p.run, p.axis, residual)
            seen = p.run.reached[p.rows]  # the others have no prediction and no residual
            residual, columns = residual[seen], columns[seen]
            if not np.isfinite(residual).all():
                return MeanSquares(0.0, 0.0, 0)
            squares += float(residual @ residual)
            fast += _within_blocks(residual, round(BLOCK_S * p.run.sample_rate_hz))
            samples += residual.size
            sums[cycle] = sums.get(cycle, 0) + columns.T @ residual
            norms[cycle] = norms.get(cycle, 0) + columns.T @ columns
        taken = sum(removed(np.outer(sums[c], sums[c]), norms[c]) for c in sums)
        count = max(samples, 1)
        return MeanSquares(squares / count, max(0.0, squares - taken) / count, samples, fast / count)


def _within_blocks(residual: Array, size: int) -> float:
    """Sum of squares of a residual [n] about its means over blocks of ``size`` samples."""
    blocks = residual[: residual.size // max(size, 1) * size].reshape(-1, max(size, 1))
    return float(np.sum((blocks - blocks.mean(axis=1, keepdims=True)) ** 2)) if blocks.size else 0.0


@dataclass(frozen=True)
class Floor:
    """The squared floor, dps^2, of all and within power cycles, and the noise of one sample, ``white``.

    ``error`` and ``error_within`` are the standard errors of a mean square of noise minus its floor, and ``fast`` is the part
    of both within blocks of 0.1 s.
    """

    all: float
    within: float
    error: float
    error_within: float
    white: float
    fast: float = 0.0


@dataclass(frozen=True)
class Level:
    """rms of held-out residuals, noise floor and excess, in deg/s; all but the floor are None if nothing can be held out.

    ``excess_within_dps`` is the excess with the offset and scale of each power cycle removed from residuals and floor, and
    ``slow_dps`` the rms without what lies within blocks of 0.1 s.
    """

    rms_dps: float | None
    floor_dps: float
    excess_dps: float | None = None
    excess_se_dps: float | None = None
    excess_within_dps: float | None = None
    excess_within_se_dps: float | None = None
    slow_dps: float | None = None

    @staticmethod
    def of(squares: MeanSquares, floor: Floor) -> Level:
        """The level computed from mean squares and the squared floor."""
        floor_dps = float(np.sqrt(max(0.0, floor.all)))  # a slope's noise is measured, and may come out below zero
        if squares.samples == 0:
            return Level(None, floor_dps)
        error, error_within = (
            float(np.hypot(a, b)) for a, b in ((floor.error, squares.error), (floor.error_within, squares.error_within))
        )
        excess, se = excess_of(squares.all - floor.all, error, floor.white / squares.samples)
        within, within_se = excess_of(squares.within - floor.within, error_within, floor.white / squares.samples)
        slow = float(np.sqrt(max(0.0, squares.all - squares.fast)))
        return Level(float(np.sqrt(squares.all)), floor_dps, excess, se, within, within_se, slow)

    def to_json(self) -> dict[str, Any]:
        return {
            "rms_dps": self.rms_dps, "floor_dps": self.floor_dps, "excess_dps": self.excess_dps,
            "excess_se_dps": self.excess_se_dps, "excess_within_dps": self.excess_within_dps,
            "excess_within_se_dps": self.excess_within_se_dps,
        }  # fmt: skip


def excess_of(difference: float, error: float, white: float) -> tuple[float, float]:
    """The excess and its standard error, deg/s, of a mean square over its floor (``difference``, dps^2).

    ``error`` is the standard error of the difference for noise alone. A systematic residual also correlates with the white
    noise by chance, which adds ``4·difference·white``; ``white`` is the noise of one sample over the number of samples, dps^2.
    The error of the excess is half the width of the interval into which one standard error moves it, as the square root has no
    slope at zero. It is at least a third of the way that three standard errors move it, up or down: an excess is beyond three
    of its errors only if the difference is.
    """
    power = max(0.0, difference)
    se = float(np.sqrt(error**2 + 4 * power * white))
    low, excess, high = (float(np.sqrt(max(0.0, power + k * se))) for k in (-3, 0, 3))
    half = float(np.sqrt(power + se) - np.sqrt(max(0.0, power - se))) / 2
    return excess, max(half, (excess - low) / 3 * BEYOND_ROUNDING, (high - excess) / 3)


def explained(before: Level, after: Level, cycles: int) -> float | None:
    """``1 - (excess after / excess before)^2``, over one floor.

    With fewer than ``Policy.few_cycles`` power cycles, or if the whole excess is not certain, the excess within power cycles is
    used, because the offset and scale of the power cycles decide the rest. It is None if the excess before is below
    ``Policy.excess_errors`` standard errors.
    """
    whole = (before.excess_dps, before.excess_se_dps, after.excess_dps)
    within = (before.excess_within_dps, before.excess_within_se_dps, after.excess_within_dps)
    for old, se, new in (within,) if cycles < POLICY.few_cycles else (whole, within):
        if old and se is not None and new is not None and old >= POLICY.excess_errors * se:
            return 1 - (new / old) ** 2
    return None


def pooled(squares: Mapping[str, MeanSquares], floors: Mapping[str, Floor], absent: Set[str] = frozenset()) -> Level:
    """The level of several axes together: their mean squares weighted by their numbers of samples.

    Axes that are ``absent``, whose readings are one value, have no part in it unless all are.
    """
    pairs = [(squares[axis], floors[axis]) for axis in squares if axis not in absent or absent >= squares.keys()]
    samples = sum(s.samples for s, _ in pairs)
    weights = [s.samples / samples if samples else 1 / len(pairs) for s, _ in pairs]

    def mean(values: Iterable[float]) -> float:
        return float(sum(w * v for w, v in zip(weights, values, strict=True)))

    def error(values: Iterable[float]) -> float:
        return float(np.sqrt(sum((w * v) ** 2 for w, v in zip(weights, values, strict=True))))

    floor = Floor(
        mean(f.all for _, f in pairs), mean(f.within for _, f in pairs), error(f.error for _, f in pairs),
        error(f.error_within for _, f in pairs), mean(f.white for _, f in pairs),
    )  # fmt: skip
    together = MeanSquares(
        mean(s.all for s, _ in pairs), mean(s.within for s, _ in pairs), samples, error=error(s.error for s, _ in pairs),
        error_within=error(s.error_within for s, _ in pairs),
    )  # fmt: skip
    return Level.of(together, floor)


def floor_of(axis: AxisFit, folds: Sequence[Fold], scatter: Scatter, clean: AxisFit | None = None) -> Floor:
    """The floor for the prediction of held-out samples by ``axis``, whose readings scatter by ``scatter`` within blocks.

    The floor is the sum of the independent parts of the noise; a part that neither of these two contains is added here. The
    noise of measured angles that their slopes keep is taken as ``clean``, the fit beside the findings, leaves it.
    """
    axis = scatter.noise_of(axis)
    power = expected(axis, folds)
    samples = max(power.samples, 1.0)
    between = 1 - power.blocks / samples  # the fraction of the scatter that is within blocks
    walks = Walks.of((clean or axis).design)
    walk = None if walks is None else walks.walk(clean or axis)
    errors, errors_within = difference_errors(axis, folds, walk)
    within = scatter.power * between + power.within / samples
    if of_slopes(axis):
        within += beyond_color(clean or axis) * power.blocks / samples
    elif axis.design.color:
        within += less_than_color(clean or axis) * power.blocks / samples
    within += errors_within.walk / samples
    of_cycles = min((power.squares - power.within + errors.walk - errors_within.walk) / samples, _largest_of_cycles(axis))
    of_level = scatter.error(int(power.blocks)) * axis.noise.white_sd_dps**2
    error, error_within = (float(np.hypot(e.noise, of_level)) / samples for e in (errors, errors_within))
    return Floor(within + of_cycles, within, error, error_within, scatter.power, scatter.power * between)


def of_misfit(axis: AxisFit, held: Iterable[Prediction], folds: Sequence[Fold]) -> MeanSquares:
    """The mean squares of the predictions of an axis that misfits, with the errors that its systematic residual adds."""
    squares = MeanSquares.of(held)
    error, within = (errors.systematic / max(squares.samples, 1) for errors in difference_errors(axis, folds))
    return replace(squares, error=error, error_within=within)


def _largest_of_cycles(axis: AxisFit) -> float:
    """The mean square, dps^2, up to which differences between power cycles count as noise."""
    square = LARGEST_SPREAD[Role.BIAS] ** 2
    if len(axis.design.layout.scenario) > 1:
        rates = [float(np.mean(b.run.rate_dps**2)) for b in axis.design.blocks if b.run.axis_index == axis.design.axis]
        square += LARGEST_SPREAD[Role.SCALE] ** 2 * float(np.mean(rates))
    return square


def beside_findings(current: AxisFit, axis: str, where: Sequence[Finding]) -> AxisFit:
    """The fit with the probes' findings as further columns, steps with a smooth curve through them."""
    shapes, runs = [f.shape for f in where if f.axis == axis and f.shape is not None], [b.run for b in current.design.blocks]
    return beside(current, axis, with_curves(current, shapes, lambda steps: steps.smooth(runs))) if shapes else current


@dataclass(frozen=True)
class Cleaned:
    """In-sample residuals of an axis without its outliers.

    ``by_run`` holds the residuals [n] of each run by its index, deg/s; outliers are moved back to their neighbours. ``noisy``
    are the same with outliers, unless these are a fault of the reading, which is no noise.
    """

    by_run: dict[int, Array]
    noisy: dict[int, Array]

    @staticmethod
    def of(fitted: Fit, axis: str) -> Cleaned:
        """The residuals of one axis without outliers, first readings and slow parts."""
        by_run: dict[int, Array] = {}
        raw: dict[int, Array] = {}
        for p in heldout.fitted(fitted.on(axis)):
            residual = p.residual_dps
            residual[:FIRST] -= begins_apart(p.run, p.axis, residual)
            rows, apart_dps = outliers_of(p.run, p.axis, residual)
            raw[p.run.index] = residual
            if rows.size:
                residual = residual.copy()
                residual[rows] -= apart_dps
            by_run[p.run.index] = residual
        moved = any(by_run[k] is not y for k, y in raw.items())
        fault = moved and single_readings(fitted.session, axis, POLICY.outlier_chance) is not None
        return Cleaned(by_run, by_run if fault else raw)


@dataclass(frozen=True)
class Remainder:
    """In-sample residuals [n] of an axis by the index of the run, deg/s, and their spectrum."""

    by_run: dict[int, Array]
    spectrum: Spectrum


def spectrum_of(fitted: Fit, axis: str, by_run: Mapping[int, Array]) -> Spectrum:
    """The spectrum of the residuals [n] of runs by their index."""
    column = AXES.index(axis)
    count_dps = max((b.run.count_dps(column) for b in fitted.blocks if b.run.index in by_run), default=0.0)
    times_s = {b.run.index: b.run.sample_s for b in fitted.blocks}
    even, rate_hz = evenly_spaced(list(by_run.values()), [times_s[i] for i in by_run], fitted.session.sample_rate_hz)
    return spectrum(even, rate_hz, count_dps=count_dps)


def scatter_of(fitted: Fit, axis: str, cleaned: Cleaned, spectrum: Spectrum) -> Scatter:
    """The scatter of residuals within blocks, without spectral lines."""
    runs, total, degrees = [], 0.0, 0
    for b in fitted.axes[axis].design.blocks:
        if b.run.index not in cleaned.by_run or b.within_n == 0:
            continue
        rows = b.start[:, None] + np.arange(int(b.n[0]))
        noisy, clean = cleaned.noisy[b.run.index], cleaned.by_run[b.run.index]
        without = None if clean is noisy else clean[rows]
        runs.append(BlocksOfRun.of(noisy[rows], without, np.ones(b.n.size) if b.weight is None else b.weight))
        end = slice(int(rows[-1, -1]) + 1, None)
        last = noisy[end][b.run.reached[end]]  # too few for a block, but an outlier may be among them
        total += float(runs[-1].squares.sum()) + float(np.sum((last - last.mean()) ** 2) if last.size else 0.0)
        degrees += b.within_n + max(0, last.size - 1)
    if degrees < POLICY.least_scatter:  # each block is one sample: use the white level of the fit
        own = np.concatenate([b.n / b.precision for b in fitted.axes[axis].design.blocks])
        return Scatter(fitted.axes[axis].noise.white_sd_dps ** 2, peaked=float(np.mean(own**2) / np.mean(own) ** 2))
    power = max(total / degrees - spectrum.line_power(POLICY.floor_line_chance), LEAST_WHITE_DPS**2)
    return Scatter(power, *unevenness(runs, degrees))
