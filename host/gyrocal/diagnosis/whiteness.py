"""The test of whiteness: whether the residuals have more power than the noise in a band of frequencies."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gyrocal.diagnosis.finding import Finding
from gyrocal.inference.blocks import BLOCK_S
from gyrocal.inference.design import SLOW_S
from gyrocal.inference.fitted import AxisFit
from gyrocal.noise.whitening import Noise
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array
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

    ``ratio`` sums power divided by the expected noise, ``beyond`` sums power minus the expected noise (dps^2).
    """

    frequency_hz: Array
    ratio: Array
    beyond: Array
    runs: int


def too_much_power(fit: AxisFit, axis: str, alarm: float) -> Finding | None:
    """Find a band of frequencies in which the residuals have more power than white noise and drift.

    The periodograms (Hann window) of the residual block means are compared with their expectation under the fitted noise.
    Variations slower than ``SLOW_S`` are drift and are not tested. Samples are not tested either, because a sensor's low-pass
    filter makes their noise coloured.
    """
    from scipy.stats import gamma

    parts = [p for p in (_periodogram(fit, index) for index in fit.design.alike) if p is not None]
    if not parts:
        return None
    frequencies = np.concatenate([p.frequency_hz for p in parts])
    ratios, powers = np.concatenate([p.ratio for p in parts]), np.concatenate([p.beyond for p in parts])
    counts = np.concatenate([np.full(p.frequency_hz.size, float(p.runs)) for p in parts])
    edges = np.geomspace(frequencies.min(), frequencies.max() * (1 + 1e-9), POLICY.bands + 1)
    worst: Finding | None = None
    for low, high in pairwise(edges):
        band = (frequencies >= low) & (frequencies < high)
        looks = float(counts[band].sum()) / HANN_NEIGHBOURS
        if looks < POLICY.least_periodogram_values:
            continue
        mean = float(ratios[band].sum() / counts[band].sum())
        chance = min(1.0, POLICY.bands * float(gamma.sf(mean * looks, looks)))
        amplitude = float(np.sqrt(max(0.0, 2 * powers[band].sum() / counts[band].mean())))
        note = f"{amplitude * 1e3:.3g} mdps between {low:.2g} and {high:.2g} Hz beyond noise"
        if chance < alarm and (worst is None or chance < worst.chance):
            sigma = (mean - 1) * float(np.sqrt(looks))
            worst = Finding(axis, Frequency.name, sigma, chance, amplitude, note, band_hz=(low, high))
    return worst


def _periodogram(fit: AxisFit, index: list[int]) -> Periodogram | None:
    """The periodogram of the runs ``index``, which have the same sampling; None if they are too short, slow or uneven."""
    from scipy.signal.windows import hann

    p = len(fit.design.layout.fixed)
    first = fit.design.blocks[index[0]]
    t_s, n, m = first.t_s, first.n, first.t_s.size
    short = m < POLICY.least_periodogram_blocks
    if short or np.ptp(n) > 0 or t_s[1] - t_s[0] < BLOCK_S / 2 or first.run.rate_is_mean:
        return None
    step_s = float(t_s[-1] - t_s[0]) / (m - 1)
    window = hann(m, sym=False)
    expected = _expected(fit.noise, window, step_s, float(n[0]))
    residual = np.empty((len(index), m))
    for row, i in zip(residual, index, strict=True):
        columns, u = fit.design.columns(i), fit.run_coefficients(i, fit.solution.beta, fit.spreads)
        row[:] = columns[0] - fit.solution.beta @ columns[1 : 1 + p] - u @ columns[1 + p :]
    power: Array = np.abs(np.fft.rfft((residual - residual.mean(axis=1, keepdims=True)) * window)) ** 2
    ratio, beyond = power / expected, 2 * (power - expected) / (m * float(window @ window))
    frequency: Array = np.fft.rfftfreq(m, step_s).astype(np.float64)
    use = (frequency > max(1 / SLOW_S, LEAST_PERIODS / (m * step_s))) & (frequency < HIGHEST / step_s)
    if not use.any():  # blocks so slow that all of it counts as drift
        return None
    return Periodogram(frequency[use], ratio.sum(axis=0)[use], beyond.sum(axis=0)[use], len(index))


def _expected(noise: Noise, window: Array, step_s: float, samples: float) -> Array:
    """Expectation of the tapered periodogram: the transform of the noise's autocovariance times that of the window."""
    from scipy.signal import fftconvolve

    m = window.size
    lags = np.arange(m)
    covariance = noise.ou_sd_dps**2 * np.exp(-lags * step_s / noise.ou_tau_s)
    covariance[0] += noise.white_sd_dps**2 / samples
    tapered = covariance * fftconvolve(window, window[::-1])[m - 1 :]
    return np.asarray(2 * np.fft.rfft(tapered, 2 * m).real[::2] - tapered[0])
