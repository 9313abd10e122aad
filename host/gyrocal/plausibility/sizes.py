"""Biases and spreads over power cycles that are too large for a gyroscope."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from gyrocal.effects.base import Role
from gyrocal.inference.fitted import Fit
from gyrocal.plausibility.runs import Mean, Means
from gyrocal.plausibility.slopes import Lines, agreed, middle_of
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array
from gyrocal.warning import Warning

Index = np.ndarray[Any, np.dtype[np.intp]]


def check(means: Means, found: Lines, accused: list[Warning], moved: list[Warning]) -> list[Warning]:
    """Biases and spreads over power cycles that are too large for a gyroscope, without runs that other warnings explain."""
    whole = {w.axis for w in accused if w.file is None}
    if any(w.code == "axes_swapped" for w in accused):
        return []
    out = []
    for axis in AXES:
        bad = {w.file for w in (*accused, *moved) if w.axis == axis}
        line = found.get((axis, axis))
        points = means.about(axis) if line is not None else means.by_axis[axis]
        points = [m for m in points if m.run.file not in bad]
        if not points:
            continue
        bias = line.bias_dps if line is not None else float(np.median([m.mean_dps for m in points]))
        if bad and line is not None and all(m.slope is None for m in points):
            bias, _ = agreed(np.array([m.rate_dps for m in points]), np.array([m.mean_dps for m in points]))
        if bias is None:
            out += [] if axis in whole else _at_one_rate(axis, points)
            continue
        if abs(bias) > POLICY.largest_bias_dps:
            text = (
                f"the bias of {axis} is {bias:.4g} dps; gyroscopes have a few. Check the zero of the counts "
                "(an offset that was not subtracted), the unit, and that the table stood still in runs at rest"
            )
            out.append(Warning("bias_implausible", axis, None, text, True))
        if axis not in whole:
            slope = middle_of(np.array([s.value for s in line.slopes])) if line is not None and line.slopes else 0.0
            own = _turn_on(axis, points, bias, slope) if line is not None else []
            out += own or _across(means, axis, accused, moved)
    return out


def of_fit(fitted: Fit, known: list[Warning], failing: Collection[str] = ()) -> list[Warning]:
    """Fitted scales that no gyroscope has, on axes about which no warning of ``known`` says why.

    On a ``failing`` axis the misfit may be the cause, as a large error of the clock is, so that the warning does not block.
    """
    out = []
    for term in fitted.model.terms:
        if term.effect.role is not Role.SCALE or any(w.blocks(term.axis) for w in known):
            continue
        scale, se = (of.get(term.effect.linear[0], 0.0) for of in (term.values, term.se))
        if abs(scale) <= POLICY.largest_scale + POLICY.turning_errors * se:
            continue
        text = (
            f"the fit gives {term.axis} a scale error of {scale:+.0%}; gyroscopes have a few percent, and the means of the "
            "runs do not show it. The reference may vary within runs as the sensor does not: check how it is mounted and its "
            "noise, or turn at several rates in one power cycle"
        )
        out.append(Warning("scale_implausible", term.axis, None, text, term.axis not in failing))
    return out


def _across(means: Means, axis: str, accused: list[Warning], moved: list[Warning]) -> list[Warning]:
    """Power cycles whose biases scatter on an axis in the runs about another, beside what the axis reads of their rate."""
    if any(w.code == "unit_rad_s" for w in accused):
        return []
    bad = {w.file for w in (*accused, *moved)}
    for about in (a for a in AXES if a != axis):
        points = [m for m in means.about(about, axis) if m.run.file not in bad and not m.run.three_axes]
        names = list(dict.fromkeys(m.run.scenario for m in points))
        if len(names) < 2:
            continue
        cycle = np.array([names.index(m.run.scenario) for m in points])
        rates, values = np.array([m.rate_dps for m in points]), np.array([m.mean_dps for m in points])
        offsets = _cycle_means(cycle, values - _common_slope(cycle, rates, values) * rates)
        if (sd := _sd(list(offsets))) > POLICY.largest_bias_spread_dps:
            return [_scatters(axis, len(names), f"their bias by {sd:.3g} dps")]
    return []


def _cycle_means(cycle: Index, values: Array) -> Array:
    """Means of values [n] over each power cycle, whose numbers [n] begin at 0."""
    return np.asarray(np.bincount(cycle, values) / np.bincount(cycle))


def _common_slope(cycle: Index, rates: Array, values: Array) -> float:
    """The slope of values [n] over rates [n], deg/s: within power cycles if they have several rates, else over all runs.

    It is 0 at a single rate.
    """
    least = POLICY.two_rates * float(np.max(np.abs(rates)))
    for middle in (_cycle_means(cycle, rates)[cycle], rates.mean()):
        apart = rates - middle
        if np.max(np.abs(apart)) > least / 2:
            return float(apart @ values) / float(apart @ apart)
    return 0.0


def _turn_on(axis: str, points: list[Mean], bias: float, slope: float) -> list[Warning]:
    cycles: dict[str, list[Mean]] = {}
    for m in points:
        cycles.setdefault(m.run.scenario, []).append(m)
    offsets, scales, granted = [], [], []
    for runs in cycles.values():
        left = np.array([m.mean_dps - bias - slope * m.rate_dps for m in runs])
        scale, lever_dps = _own_scale(runs, left, slope)
        if lever_dps > 0:
            scales.append(scale)
            granted.append(POLICY.hidden_dps / lever_dps)
        offsets.append(float(np.mean(left - scale * np.array([m.rate_dps for m in runs]))))
    bias_sd, scale_sd = _sd(offsets), _beyond(_sd(scales), granted)
    if slope and len(points) == len(cycles) and not any(m.slope is not None for m in points):
        scale_sd = _scale_sd_of_single_runs(points, bias)
    if bias_sd <= POLICY.largest_bias_spread_dps and scale_sd <= POLICY.largest_scale_spread:
        return []
    how = f"bias by {bias_sd:.3g} dps" if bias_sd > POLICY.largest_bias_spread_dps else f"scale by {scale_sd:.0%}"
    return [_scatters(axis, len(cycles), f"their {how}")]


def _own_scale(runs: list[Mean], left_dps: Array, slope: float) -> tuple[float, float]:
    """The scale of one power cycle beyond the common slope, and the rates that show it, deg/s: root of the sum of squares.

    It comes from the runs with slopes of their own, else from the means left [n] of runs of several rates, else it is 0.
    """
    swings = [m for m in runs if m.slope is not None]
    rates = np.array([m.rate_dps for m in runs])
    if not slope:
        return 0.0, 0.0
    if swings:
        lever_dps = float(np.linalg.norm([np.std(m.run.rate_dps) for m in swings]))
        return float(np.mean([m.slope for m in swings])) - slope, lever_dps
    if np.ptp(rates) <= POLICY.two_rates * np.max(np.abs(rates)):
        return 0.0, 0.0
    about = rates - rates.mean()
    return float(about @ left_dps) / float(about @ about), float(np.linalg.norm(about))


def _beyond(sd: float, granted: list[float]) -> float:
    """A standard deviation beyond the root mean square of errors that are granted."""
    return max(0.0, sd**2 - float(np.mean(np.square(granted)))) ** 0.5 if granted else sd


def _at_one_rate(axis: str, points: list[Mean]) -> list[Warning]:
    """Power cycles at a single rate that scatter by more than the sum of both limits. Offset and scale are equivalent there."""
    turning = [m for m in points if m.slope is None and not m.rests and not m.run.rate_is_mean]
    cycles: dict[str, list[float]] = {}
    for m in turning:
        cycles.setdefault(m.run.scenario, []).append(m.mean_dps)
    sd = _sd([float(np.mean(means)) for means in cycles.values()])
    rate_dps = max((abs(m.rate_dps) for m in turning), default=0.0)
    if sd <= np.hypot(POLICY.largest_bias_spread_dps, POLICY.largest_scale_spread * rate_dps):
        return []
    return [_scatters(axis, len(cycles), f"what they read at {rate_dps:.4g} dps by {sd:.3g} dps")]


def _sd(values: list[float]) -> float:
    return float(np.std(values, ddof=1)) if len(values) > 1 else 0.0


def _scatters(axis: str, cycles: int, how: str) -> Warning:
    text = (
        f"on {axis}, {cycles} power cycles scatter in {how} (one sigma), at least a hundred times as much as usual. "
        "Check faces and rates of the runs, and which of them share a scenario (a power cycle)"
    )
    return Warning("turn_on_implausible", axis, None, text, True)


def _scale_sd_of_single_runs(points: list[Mean], bias: float) -> float:
    """Scatter of the scale over power cycles of one run each, beyond the part that ``Policy.granted_offset_dps`` explains."""
    turning = [m for m in points if m.slope is None and not m.rests]
    if len(turning) < POLICY.few_runs:
        return 0.0
    rates = np.array([m.rate_dps for m in turning])
    values = (np.array([m.mean_dps for m in turning]) - bias) / rates
    return _beyond(_sd(list(values)), list(POLICY.granted_offset_dps / rates))
