"""Spectra of the residual as they are drawn, over time and over the table's angle, from one period in the longest run on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gyrocal.diagnosis.residual.comparison import Comparison
from gyrocal.effects.order_tone import turned_turn
from gyrocal.noise.orders import order_spectrum
from gyrocal.present.decimate import Stretches, by_octave
from gyrocal.recording.session import Array, Run

STRETCHES = 600
TAPER = 0.25


@dataclass(frozen=True)
class Curve:
    """A measured curve and what noise alone is expected to give.

    ``low`` and ``high`` are the extremes of the intervals ``first`` to ``last`` whose mean is ``y``; empty if every point is
    drawn.
    """

    x: list[float]
    y: list[float]
    expected: list[float]
    first: list[float] = field(default_factory=list)
    last: list[float] = field(default_factory=list)
    low: list[float] = field(default_factory=list)
    high: list[float] = field(default_factory=list)


def density(residuals: Sequence[Array], rate_hz: float) -> tuple[Array, Array]:
    """Frequency [f], Hz, and one-sided density [f], dps^2/Hz: the mean of the periodograms of whole runs [n], deg/s.

    It begins at one period in the longest run. A shorter run counts from its own lowest frequency on.
    """
    from scipy.signal.windows import tukey

    longest = max((r.size for r in residuals), default=0)
    if longest < 4:
        return np.zeros(0), np.zeros(0)
    frequency = np.fft.rfftfreq(longest, 1 / rate_hz)[1:]
    total, weight = np.zeros(frequency.size), np.zeros(frequency.size)
    for r in residuals:
        if r.size < 4:
            continue
        window = tukey(r.size, TAPER)
        power = 2 * np.abs(np.fft.rfft((r - r.mean()) * window)) ** 2 / (rate_hz * float((window**2).sum()))
        own = np.fft.rfftfreq(r.size, 1 / rate_hz)
        reached = frequency >= own[1] * (1 - 1e-9)
        total[reached] += r.size * np.interp(frequency[reached], own, power)
        weight[reached] += r.size
    return np.asarray(frequency, dtype=float), total / np.maximum(weight, 1)


def against_frequency(found: Comparison, axis: str, residuals: Sequence[Array]) -> Curve:
    """The amplitude density in dps/sqrt(Hz). Noise alone is the level between lines, and below it the noise model."""
    rate_hz = found.fit.session.sample_rate_hz
    frequency, power = density(residuals, rate_hz)
    noise = found.fit.axes[axis].noise
    x, s = by_octave(frequency, np.sqrt(power), STRETCHES)
    expected = 2 * noise.white_sd_dps**2 / rate_hz + np.zeros(x.size)
    if noise.ou_sd_dps > 0:
        expected += 4 * noise.ou_sd_dps**2 * noise.ou_tau_s / (1 + (2 * np.pi * x * noise.ou_tau_s) ** 2)
    between = found.spectra[axis]
    if between.frequency_hz.size:
        known = x >= between.frequency_hz[0]
        expected[known] = np.interp(x[known], between.frequency_hz, between.level)
    return _curve(x, s, np.sqrt(expected))


def against_order(found: Comparison, axis: str, residuals: Mapping[int, Array]) -> Curve | None:
    """The amplitude in deg/s at each number of periods per turn of the table; None if the table hardly turns."""
    runs: dict[int, Run] = {b.run.index: b.run.about(axis) for b in found.fit.blocks}
    turning = [i for i in residuals if not runs[i].rate_is_mean and bool(np.any(runs[i].rate_dps))]
    lines = order_spectrum([residuals[i] for i in turning], [turned_turn(runs[i]) for i in turning], whole=True)
    if not lines.order.size:
        return None
    x, s = by_octave(lines.order, np.sqrt(lines.power), STRETCHES)
    white = found.fit.axes[axis].noise.white_sd_dps
    alone = float(np.sqrt(np.mean([4 * white**2 / residuals[i].size for i in turning])))
    return _curve(x, s, np.full(x.size, alone))


def _curve(x: Any, s: Stretches, expected: Array) -> Curve:
    columns = (x, s.mean, expected, s.first, s.last, s.low, s.high)
    return Curve(*(np.asarray(column, dtype=float).tolist() for column in columns))
