"""A wave over the rate's value: the nonlinearity of a converter, which no effect of the library describes.

Its error returns many times over the range of the rate. An asymmetry of the scale or the steps of a staircase, which look like
a tone, explain a part of it. The period is searched in the residual; it is at most half of the range, because a longer wave is
a polynomial of the rate, as effects of the library are, and each period must hold several of the rates that were measured:
between them nothing shows a wave.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from gyrocal import tails
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.diagnosis.residual.probes import probe
from gyrocal.effects.quantities import true_rate_dps
from gyrocal.inference.fitted import AxisFit
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array, Run
from gyrocal.variables.rate import Rate
from gyrocal.variables.shapes import Columns

FEWEST_CYCLES, STEP = 2.0, 0.25
"""Periods over the range of the rate that are tried: the fewest, and the step from one to the next."""


@dataclass(frozen=True)
class RateWave:
    """The wave over the rate that describes a residual best.

    ``gain`` is what white noise alone would gain in log-likelihood with it, ``looks`` the number of periods that were tried.
    """

    shape: Columns
    gain: float
    looks: int

    @property
    def penalty(self) -> float:
        """The logarithm of the number of periods that were tried."""
        return math.log(self.looks)


def rate_wave(current: AxisFit) -> RateWave | None:
    """The best wave over the rate in what a fit leaves; None if the rate takes too few values or is not known."""
    blocks = current.design.blocks
    if any(b.run.rate_is_mean for b in blocks):
        return None
    rates = np.concatenate([b.mean(true_rate_dps(b.run)[:, None])[:, 0] for b in blocks])
    span = float(np.ptp(rates))
    if not np.isfinite(span) or span == 0:
        return None
    most = min(POLICY.most_rate_cycles, _different(rates) / POLICY.rates_per_wave)
    cycles = np.arange(FEWEST_CYCLES, most + STEP / 2, STEP)
    if cycles.size == 0:
        return None
    weight = np.sqrt(np.concatenate([b.n for b in blocks]))
    residual = np.concatenate([current.block_residuals(i) for i in range(len(blocks))]) * weight
    known = np.linalg.qr(np.column_stack([np.ones(rates.size), rates / span]) * weight[:, None])[0]
    residual = residual - known @ (known.T @ residual)

    def power(cycles: float) -> float:
        wave = _wave(rates, span / cycles) * weight[:, None]
        wave = np.linalg.qr(wave - known @ (known.T @ wave))[0]
        return float(np.sum((wave.T @ residual) ** 2))

    powers = [power(c) for c in cycles]
    best = int(np.argmax(powers))
    period_dps = span / float(cycles[best])
    words = f"as a wave over the rate with a period of {period_dps:.3g} dps"
    gain = 0.5 * powers[best] / current.noise.white_sd_dps**2
    return RateWave(Columns(_of(period_dps), 2, words), gain, cycles.size)


def over_rate(current: AxisFit, axis: str, alarm: float) -> Finding | None:
    """Test for a wave over the rate. The chance counts every period that was tried."""
    wave = rate_wave(current)
    if wave is None or float(tails.chi_square(2 * wave.gain, 2)) * wave.looks >= alarm:
        return None
    found = probe(current, axis, Rate.name, wave.shape, alarm / wave.looks)
    return None if found is None or found.chance * wave.looks >= alarm else replace(found, chance=found.chance * wave.looks)


def _different(rates_dps: Array) -> int:
    """The number of rates [blocks] that differ by more than a hundredth of their range, without those of few blocks.

    A block in which the rate steps has a mean between both levels, and does not show what the sensor reads there.
    """
    ordered = np.sort(rates_dps)
    width = POLICY.rates_alike * (ordered[-1] - ordered[0])
    held, at = [], 0
    while at < ordered.size:
        beyond = int(np.searchsorted(ordered, ordered[at] + width, side="right"))
        held.append(beyond - at)
        at = beyond
    together = np.cumsum(np.sort(held)[::-1])
    return int(np.searchsorted(together, POLICY.rates_kept * ordered.size)) + 1


def _of(period_dps: float) -> Callable[[Run], Array]:
    return lambda run: _wave(true_rate_dps(run), period_dps)


def _wave(rate_dps: Array, period_dps: float) -> Array:
    """Cosine and sine [n, 2] over the rate [n]."""
    phase = 2 * np.pi * rate_dps / period_dps
    return np.column_stack([np.cos(phase), np.sin(phase)])
