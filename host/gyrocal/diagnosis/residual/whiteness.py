"""The test of whiteness: whether the residuals have more power than the noise in a band of frequencies."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import reduce
from itertools import pairwise

import numpy as np

from gyrocal import tails
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.inference.blocks import BLOCK_S
from gyrocal.inference.design import SLOW_S
from gyrocal.inference.fitted import AxisFit
from gyrocal.noise.whitening import Noise
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array
from gyrocal.units import rate_text
from gyrocal.variables.frequency import Frequency

HANN_NEIGHBOURS = 1.95
"""Neighbouring values of a periodogram with a Hann window are correlated: this many count as one independent value."""
HIGHEST = 0.49
"""Highest frequency that block means show, as a fraction of the block rate."""
LEAST_PERIODS = 2.5
"""Number of periods of the lowest tested frequency within the length of a run."""


@dataclass(frozen=True)
class Periodogram:
    """Sums over runs with the same sampling, at each frequency [f].

    ``ratio`` sums power divided by the expected noise, ``power`` sums power (dps^2).
    """

    frequency_hz: Array
    ratio: Array
    power: Array
    runs: int


@dataclass(frozen=True)
class _Band:
    """A band of frequencies: the sum of ``ratio``, the power in one run (dps^2), and the number of values."""

    low_hz: float
    high_hz: float
    ratio: float
    power: float
    values: float

    @property
    def looks(self) -> float:
        """Number of independent values."""
        return self.values / HANN_NEIGHBOURS

    @property
    def mean(self) -> float:
        return self.ratio / self.values

    def with_next(self, other: _Band) -> _Band:
        return _Band(
            self.low_hz, other.high_hz, self.ratio + other.ratio, self.power + other.power, self.values + other.values
        )


def too_much_power(fit: AxisFit, axis: str, alarm: float) -> Finding | None:
    """Find a band of frequencies in which the residuals have more power than in the bands beside it.

    The periodograms (Hann window) of the residual block means are divided by their expectation under the fitted noise. Noise
    that this model describes only roughly (flicker noise, a low-pass filter) still falls with frequency, so it never exceeds
    both sides of a band. Variations slower than ``SLOW_S`` are drift and are not tested.
    """
    bands = _bands(fit)
    ranges = [(first, last) for first in range(1, len(bands)) for last in range(first, len(bands))]
    worst: Finding | None = None
    for first, last in ranges:
        band = reduce(_Band.with_next, bands[first : last + 1])
        beside = [bands[first - 1], *bands[last + 1 : last + 2]]
        if not all(other.mean > 0 for other in beside):  # absurd readings, beside which rounding has left nothing
            continue
        chances = [_chance(band, other) for other in beside]
        chance = min(1.0, len(ranges) * max(chances))
        if chance < alarm and (worst is None or chance < worst.chance):
            side = max(other.mean for other in beside)
            amplitude = float(np.sqrt(2 * band.power * max(0.0, 1 - side / band.mean)))
            note = f"{rate_text(amplitude)} between {band.low_hz:.2g} and {band.high_hz:.2g} Hz beyond noise"
            sigma = float(tails.normal_z(max(chance, np.finfo(np.float64).tiny)))
            worst = Finding(
                axis, Frequency.name, sigma, chance, amplitude, note, snr=(band.mean / side - 1) * float(np.sqrt(band.looks)),
                band_hz=(band.low_hz, band.high_hz),
            )  # fmt: skip
    return worst


def _chance(band: _Band, other: _Band) -> float:
    """Probability that noise of one level gives ``band`` so much more power than ``other``: both are Gamma-distributed."""
    return float(tails.f_ratio(band.mean / other.mean, 2 * band.looks, 2 * other.looks))


def _bands(fit: AxisFit) -> list[_Band]:
    """The periodograms of all runs in ``Policy.bands`` bands; those of too few values are joined with the next."""
    parts = periodograms(fit)
    if not parts:
        return []
    frequencies = np.concatenate([p.frequency_hz for p in parts])
    runs = sum(p.runs for p in parts)
    ratios, powers = np.concatenate([p.ratio for p in parts]), np.concatenate([p.power / runs for p in parts])
    counts = np.concatenate([np.full(p.frequency_hz.size, float(p.runs)) for p in parts])
    edges = np.geomspace(frequencies.min(), frequencies.max() * (1 + 1e-9), POLICY.bands + 1)
    bands: list[_Band] = []
    for low, high in pairwise(edges):
        inside = (frequencies >= low) & (frequencies < high)
        sums = (float(of[inside].sum()) for of in (ratios, powers, counts))
        band = _Band(float(low), float(high), *sums)
        if bands and bands[-1].looks < POLICY.least_periodogram_values:
            band = bands.pop().with_next(band)
        bands.append(band)
    return bands if bands[-1].looks >= POLICY.least_periodogram_values else bands[:-1]


def periodograms(fit: AxisFit, drift: bool = True) -> list[Periodogram]:
    """The periodograms of all runs that have one. ``drift`` is False if the ratios are those to the white noise alone."""
    noise = fit.noise if drift else replace(fit.noise, ou_sd_dps=0.0)
    return [p for p in (_periodogram(fit, noise, index) for index in fit.design.alike) if p is not None]


def _periodogram(fit: AxisFit, noise: Noise, index: list[int]) -> Periodogram | None:
    """The periodogram of the runs ``index``, which have the same sampling; None if they are too short, slow or uneven."""
    first = fit.design.blocks[index[0]]
    t_s, n, m = first.t_s, first.n, first.t_s.size
    short = m < POLICY.least_periodogram_blocks
    if short or np.ptp(n) > 0 or t_s[1] - t_s[0] < BLOCK_S / 2 or first.run.rate_is_mean:
        return None
    step_s = float(t_s[-1] - t_s[0]) / (m - 1)
    window = np.hanning(m + 1)[:-1]
    weight = np.sqrt(first.precision / n)  # blocks of equal noise
    expected = _expected(noise, window * weight, step_s, first.precision)
    residual = np.stack([fit.block_residuals(i) for i in index]) * weight
    power: Array = np.abs(np.fft.rfft((residual - residual.mean(axis=1, keepdims=True)) * window)) ** 2
    ratio, power = power / expected, 2 * power / (m * float(window @ window))
    frequency: Array = np.fft.rfftfreq(m, step_s).astype(np.float64)
    use = (frequency > max(1 / SLOW_S, LEAST_PERIODS / (m * step_s))) & (frequency < HIGHEST / step_s)
    if not use.any():  # blocks so slow that all of it counts as drift
        return None
    return Periodogram(frequency[use], ratio.sum(axis=0)[use], power.sum(axis=0)[use], len(index))


def _expected(noise: Noise, window: Array, step_s: float, precision: Array) -> Array:
    """Expectation of the tapered periodogram: the transform of the noise's autocovariance times that of the window.

    ``precision`` [m] is the number of usual samples that each block counts for. The colour of the white noise is left out: it
    makes the ratio fall with frequency, where an imperfect description of it could make the ratio rise.
    """
    m = window.size
    lags = np.arange(m)
    drift = noise.ou_sd_dps**2 * np.exp(-lags * step_s / noise.ou_tau_s)
    white = float(window**2 @ (1 / precision)) / float(window @ window) * noise.white_sd_dps**2
    tapered = (drift + np.where(lags == 0, white, 0.0)) * np.fft.irfft(np.abs(np.fft.rfft(window, 2 * m)) ** 2, 2 * m)[:m]
    return np.asarray(2 * np.fft.rfft(tapered, 2 * m).real[::2] - tapered[0])
