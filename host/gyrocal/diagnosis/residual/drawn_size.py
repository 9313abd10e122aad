"""Size and words of a finding, taken from the residual that a picture draws, so that both say the same.

The residual is that of the model as it stands, in block means. The test of a finding fits its shape together with the model
instead, and part of that shape may be what the model absorbs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.effects.quantities import true_rate_dps
from gyrocal.inference.fitted import AxisFit
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array
from gyrocal.units import part_text, rate_text
from gyrocal.variables.shapes import Columns, Shape, ShapeOfEachRun, Steps, StepsOfRuns, Waves, per_turn


def described(current: AxisFit, shape: Shape) -> tuple[float, str]:
    """Amplitude in deg/s and words of a shape that is the same in all runs. The amplitude is that of a sine of equal power."""
    if isinstance(shape, Steps):
        return _steps(current, shape)
    residuals = [current.block_residuals(i) for i in range(len(current.design.blocks))]
    columns = np.concatenate([b.mean(shape.columns(b.run, current.design.axis, {})) for b in current.design.blocks])
    shown = np.any(columns != 0, axis=1)
    columns = columns - columns.mean(axis=0) if shown.all() else columns
    coefficients = np.linalg.lstsq(columns, np.concatenate(residuals), rcond=None)[0]
    amplitude = float(np.sqrt(2 * np.mean((columns[shown] @ coefficients) ** 2)))
    size = _size(amplitude)
    if isinstance(shape, Waves):
        sizes = np.hypot(coefficients[::2], coefficients[1::2])
        k = int(np.argmax(sizes))
        phase = ", of the same phase in each run" if len(residuals) > 1 else ""
        if sizes[k] > POLICY.cancelled * amplitude:  # in less than a turn, waves cancel each other
            return amplitude, f"{size}{phase}"
        wave = f"a wave of {rate_text(min(sizes[k], amplitude))} {per_turn(shape.orders[k])}"
        return amplitude, f"{size}; mostly {wave}{phase}"
    words = shape.words if isinstance(shape, Columns) else ""
    return amplitude, f"{size}, {words}" if words else size


def described_again(current: AxisFit, finding: Finding) -> Finding:
    """A finding in the size and words of another residual: that of the fit which is drawn.

    What differs from run to run, or happens in single runs, keeps its own.
    """
    shape, runs = finding.shape, [b.run for b in current.design.blocks]
    if shape is None or isinstance(shape, (ShapeOfEachRun, StepsOfRuns)) or any(map(shape.lacks, runs)):
        return finding
    amplitude_dps, note = described(current, shape)
    return replace(finding, amplitude_dps=amplitude_dps, note=note)


def most_visible(current: AxisFit, shapes: Sequence[tuple[str, Shape]]) -> tuple[str, Shape] | None:
    """The variable and shape with the fewest columns that the residual as drawn follows nearly as well as any other.

    None if no shape describes ``Policy.visible`` of the residual's mean square about its mean.
    """
    residual = np.concatenate([current.block_residuals(i) for i in range(len(current.design.blocks))])
    return most_visible_of(current, residual, shapes)


def most_visible_of(current: AxisFit, residual: Array, shapes: Sequence[tuple[str, Shape]]) -> tuple[str, Shape] | None:
    """The same of any ``residual`` [m] in the blocks of an axis, deg/s."""
    power = float(np.sum((residual - residual.mean()) ** 2))
    parts = []
    for name, shape in shapes:
        if not isinstance(shape, ShapeOfEachRun) and not any(map(shape.lacks, (b.run for b in current.design.blocks))):
            columns = np.concatenate([b.mean(shape.columns(b.run, current.design.axis, {})) for b in current.design.blocks])
            known = np.column_stack([np.ones(residual.size), columns])
            left = residual - known @ np.linalg.lstsq(known, residual, rcond=None)[0]
            parts.append((1 - float(left @ left) / max(power, 1e-300), name, shape))
    best = max((part for part, _, _ in parts), default=0.0)
    if best < POLICY.visible:
        return None
    _, name, shape = min((p for p in parts if p[0] > best - POLICY.alike), key=lambda p: len(p[2].linear))
    return name, shape


def variance(current: AxisFit) -> float:
    """The mean square of the residual, as drawn, about its mean, dps^2."""
    return float(np.var(np.concatenate([current.block_residuals(i) for i in range(len(current.design.blocks))])))


def drawn_power(current: AxisFit, finding: Finding) -> float:
    """The mean square of the residual, as drawn, that a finding describes, dps^2.

    For a shape, it is what the shape describes beyond what as many columns describe of noise. Steps of single runs are told
    from the level of their own run, which the bias of another power cycle does not reach.
    """
    shape = finding.shape
    if shape is None:
        return finding.amplitude_dps**2 / 2
    blocks, axis = current.design.blocks, current.design.axis
    parts = [(current.block_residuals(i), b.mean(shape.columns(b.run, axis, {}))) for i, b in enumerate(blocks)]
    if isinstance(shape, StepsOfRuns):
        parts = [(y - y.mean(), np.column_stack([np.ones(y.size), c[:, c.any(axis=0)]])) for y, c in parts]
    residual = np.concatenate([y for y, _ in parts])
    if not isinstance(shape, (ShapeOfEachRun, StepsOfRuns)):
        residual = residual - residual.mean()
        columns = np.concatenate([c for _, c in parts])
        parts = [(residual, np.column_stack([np.ones(residual.size), columns]))]
    left = sum(float(np.sum((y - c @ np.linalg.lstsq(c, y, rcond=None)[0]) ** 2)) for y, c in parts)
    free = max(residual.size - sum(c.shape[1] for _, c in parts), 1)
    return max(0.0, float(np.mean(residual**2)) - left / free)


def described_of_each_run(fitted: AxisFit, shape: ShapeOfEachRun) -> tuple[float, str]:
    """Amplitude in deg/s and words of a shape with its own size in each run: the root mean square over the runs with it."""
    k = len(shape.linear)
    runs = range(len(fitted.design.blocks))
    sizes = np.array([fitted.run_coefficients(i, fitted.solution.beta, fitted.spreads)[-k:] for i in runs])
    squares = np.sum(sizes**2, axis=1)
    shown = squares > 0
    amplitude = float(np.sqrt(np.mean(squares[shown]))) if shown.any() else 0.0
    return amplitude, f"{rate_text(amplitude)} {shape.words(sizes)}"


def _steps(current: AxisFit, shape: Steps) -> tuple[float, str]:
    """The step that holds most of the shape's power: its mean residual (or residual per rate) about the mean of all."""
    known = [(i, b) for i, b in enumerate(current.design.blocks) if not shape.lacks(b.run)]
    blocks, residual = [b for _, b in known], np.concatenate([current.block_residuals(i) for i, _ in known])
    step = np.concatenate([shape.of_samples(b.run)[b.start] for b in blocks])
    rate_dps = np.concatenate([b.mean(true_rate_dps(b.run)[:, None])[:, 0] for b in blocks])
    base = rate_dps if shape.times_rate else np.ones_like(residual)
    count = shape.edges.size + 1
    weight = np.bincount(step, base**2, count)
    seen = weight > 0
    values = np.bincount(step, base * residual, count) / np.where(seen, weight, 1.0)
    centred = np.where(seen, values - float(np.average(values, weights=weight)), 0.0)
    amplitude = float(np.sqrt(2 * np.mean((centred[step] * base) ** 2)))
    k = int(np.argmax(weight * centred**2))
    most = f"{part_text(centred[k], '+')} of the rate" if shape.times_rate else rate_text(centred[k], "+")
    return amplitude, f"{_size(amplitude)}; mostly {most}, {_between(shape, k)}"


def _size(amplitude_dps: float) -> str:
    """The root mean square of a shape that is no sine, in words."""
    return f"rms {rate_text(amplitude_dps / np.sqrt(2))}"


def _between(shape: Steps, k: int) -> str:
    if shape.names:
        return shape.names[k]
    unit = f" {shape.unit}" if shape.unit else ""
    if k == 0:
        return f"below {shape.edges[0]:.4g}{unit}"
    low = f"from {shape.edges[k - 1]:.4g}"
    return f"{low} to {shape.edges[k]:.4g}{unit}" if k < shape.edges.size else f"{low}{unit} up"
