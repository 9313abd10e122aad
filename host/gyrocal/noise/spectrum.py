"""Spectra of residuals: spectral lines, bumps, and the level between the lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

LOWEST_HZ = 1.0
LONGEST_SAMPLES = 1 << 14
LEAST_SAMPLES = 32
PAD = 2
"""Zero-padding factor of the periodogram. A line may lie between the frequencies of the unpadded one."""
BUMP_WIDTHS_HZ = (2.0, 4.0, 8.0)
TAPER = 0.25
"""Fraction of a segment with a cosine taper. A line keeps most of its power, and slow variations do not leak into it."""


@dataclass(frozen=True)
class Peak:
    """The strongest line. ``chance`` is the probability that noise produces such a line anywhere in the spectrum."""

    frequency_hz: float
    amplitude_dps: float
    chance: float


@dataclass(frozen=True)
class Bump:
    """A band with more power than its neighbours.

    ``sigma`` is its significance in standard deviations. ``chance`` is the probability that noise produces such a band anywhere
    in the spectrum.
    """

    low_hz: float
    high_hz: float
    amplitude_dps: float
    sigma: float
    chance: float


@dataclass(frozen=True)
class Spectrum:
    """Periodograms averaged over ``segments`` segments of equal length.

    ``power`` [f] is the one-sided density in dps^2/Hz. ``level`` [f] is the density between the lines (a running median).
    ``tail`` [f] is the probability that noise alone reaches ``power`` at that frequency.
    """

    frequency_hz: Array
    power: Array
    level: Array
    tail: Array
    segments: int
    samples: int

    @property
    def ratio(self) -> Array:
        return self.power / self.level

    def peak(self) -> Peak | None:
        """The strongest line; None if there is no spectrum."""
        if self.frequency_hz.size == 0:
            return None
        k = int(np.argmin(self.tail)) if self.tail.min() > 0 else int(np.argmax(self.ratio))
        bin_hz = float(self.frequency_hz[1] - self.frequency_hz[0])
        near = slice(max(0, k - 2 * PAD), k + 2 * PAD + 1)
        line_power = float(np.maximum(self.power[near] - self.level[near], 0).sum() * bin_hz)
        chance = min(1.0, float(self.tail[k]) * self.frequency_hz.size)
        return Peak(float(self.frequency_hz[k]), float(np.sqrt(2 * line_power)), chance)

    def bump(self) -> Bump | None:
        """The most significant band with more power than both its neighbours; None if there is none.

        A tone that sweeps or wanders produces a bump but no line. The median of a band is compared with the medians of the
        bands beside it, because a median is insensitive to a line. A sensor's low-pass filter also changes the level, but by
        less than ``Policy.bump`` over the width of a band.
        """
        from scipy.ndimage import median_filter
        from scipy.stats import norm

        if self.frequency_hz.size == 0:
            return None
        bin_hz = float(self.frequency_hz[1] - self.frequency_hz[0])
        looks = 0
        best: Bump | None = None
        for width_hz in BUMP_WIDTHS_HZ:
            half = round(width_hz / bin_hz / 2)
            width = 2 * half + 1
            if half < 8 or 3 * width > self.power.size:
                continue
            level = median_filter(self.power, width)
            middle = level[half + width : -half - width]
            sides = (level[half : -half - 2 * width] + level[half + 2 * width : -half]) / 2
            ratio = middle / np.maximum(sides, np.finfo(np.float64).tiny)
            independent = width / PAD * self.segments * (1 - TAPER / 2) * 2 / np.pi
            sigma = np.log(np.maximum(ratio, np.finfo(np.float64).tiny)) / np.sqrt(1.5 / independent)
            looks += ratio.size
            k = int(np.argmax(sigma))
            if ratio[k] > 1 + POLICY.bump and (best is None or sigma[k] > best.sigma):
                low_hz = float(self.frequency_hz[k + width])
                amplitude_dps = float(np.sqrt(2 * (middle[k] - sides[k]) * width * bin_hz))
                best = Bump(low_hz, low_hz + width * bin_hz, amplitude_dps, float(sigma[k]), 1.0)
        return None if best is None else replace(best, chance=min(1.0, looks * float(norm.sf(best.sigma))))

    def line_power(self, chance: float) -> float:
        """Mean square in lines that noise produces with a probability below ``chance``, dps^2."""
        lines = self.tail * self.frequency_hz.size < chance
        near = np.any([np.roll(lines, shift) for shift in range(-PAD, PAD + 1)], axis=0)
        bin_hz = float(self.frequency_hz[1] - self.frequency_hz[0]) if self.frequency_hz.size > 1 else 0.0
        return float(np.maximum(self.power[near] - self.level[near], 0).sum() * bin_hz)


def spectrum(residuals: Sequence[Array], rate_hz: float, lowest_hz: float = LOWEST_HZ) -> Spectrum:
    """Average periodogram of several residuals [n] in deg/s, sampled at ``rate_hz``.

    Each residual is cut into segments. The segments are as long as the shortest residual, but at most ``LONGEST_SAMPLES``. The
    spectrum is empty if the residuals are too short.
    """
    from scipy.ndimage import median_filter
    from scipy.signal.windows import tukey
    from scipy.stats import gamma

    empty = np.zeros(0)
    length = min(min((r.size for r in residuals), default=0), LONGEST_SAMPLES)
    if length < LEAST_SAMPLES:
        return Spectrum(empty, empty, empty, empty, 0, length)
    window = tukey(length, TAPER)
    gain = rate_hz * float((window**2).sum())
    total = np.zeros(PAD * length // 2 + 1)
    segments = 0
    for r in residuals:
        for start in range(0, r.size - length + 1, length):
            piece = r[start : start + length]
            total += 2 * np.abs(np.fft.rfft((piece - piece.mean()) * window, PAD * length)) ** 2 / gain
            segments += 1
    frequency = np.fft.rfftfreq(PAD * length, 1 / rate_hz)
    use = (frequency >= lowest_hz) & (frequency < rate_hz / 2)
    power: Array = total[use] / max(segments, 1)
    if power.size < 8 or not power.any():
        return Spectrum(empty, empty, empty, empty, segments, length)
    width = min(power.size, max(31, power.size // 3)) | 1
    # a value of the averaged periodogram is Gamma(segments)/segments times the level; its median is slightly below its mean
    level = median_filter(power, width, mode="reflect").astype(np.float64) / (gamma.ppf(0.5, segments) / segments)
    level = np.maximum(level, np.finfo(np.float64).tiny)  # constant readings have no level
    tail: Array = gamma.sf(power / level * segments, segments)
    return Spectrum(np.asarray(frequency[use], dtype=np.float64), power, level, tail, segments, length)
