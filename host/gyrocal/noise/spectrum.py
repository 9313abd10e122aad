"""Spectra of residuals: spectral lines, bumps, and the level between the lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gyrocal import tails
from gyrocal.noise.level import smooth_level
from gyrocal.noise.steady import as_many, relative_levels, shrunk
from gyrocal.policy import POLICY
from gyrocal.recording.session import Array

Index = np.ndarray[Any, np.dtype[np.intp]]

LOWEST_HZ = 1.0
LONGEST_SAMPLES = 1 << 14
LEAST_SAMPLES = 32
NO_POWER = 1e-30
"""Power of a reading that never changes, as a fraction of its segment's."""
MOST_MISSING = 0.2
"""Largest part of a run's samples that may be missing between the others."""
PAD = 2
"""Zero-padding factor of the periodogram. A line may lie between the frequencies of the unpadded one."""
SAME_LINE_HZ = 0.1
"""Distance within which two peaks are one line, Hz."""
BUMP_WIDTHS_HZ = (2.0, 4.0, 8.0)
LOOKS_OF_A_BAND = 2
"""Independent positions of a band within its own width. With two, at most one spectrum of noise in ten has a chance of 0.1."""
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

    ``power`` [f] is the one-sided density in dps^2/Hz, and ``level`` [f] the smooth density between the lines
    (``noise/level.py``). ``ratio`` [f] is the power over that level where every segment counts relative to its own noise.
    ``tail`` [f] is the probability that noise alone reaches ``ratio`` at that frequency, where the level is itself an estimate.
    """

    frequency_hz: Array
    power: Array
    level: Array
    ratio: Array
    tail: Array
    segments: int
    samples: int

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

    def without_line(self, frequency_hz: float) -> Spectrum:
        """The spectrum, in which no line is found near a frequency."""
        inside = np.abs(self.frequency_hz - frequency_hz) <= SAME_LINE_HZ
        return replace(self, ratio=np.where(inside, 0.0, self.ratio), tail=np.where(inside, 1.0, self.tail))

    def bump(self) -> Bump | None:
        """The most significant band with more power than both its neighbours; None if there is none.

        A tone that sweeps or wanders produces a bump but no line. The median of a band is compared with the larger of the
        medians of the bands beside it, because a median is insensitive to a line. Noise whose density falls with frequency,
        such as flicker noise or noise behind a low-pass filter, never exceeds both sides.
        """
        from scipy.ndimage import median_filter

        if self.frequency_hz.size == 0:
            return None
        tiny = np.finfo(np.float64).tiny
        bin_hz = float(self.frequency_hz[1] - self.frequency_hz[0])
        looks = 0.0
        best: Bump | None = None
        for width_hz in BUMP_WIDTHS_HZ:
            half = round(width_hz / bin_hz / 2)
            width = 2 * half + 1
            if half < 8 or 3 * width > self.power.size:
                continue
            level = median_filter(self.ratio * self.level, width)
            middle = level[half + width : -half - width]
            sides = np.maximum(level[half : -half - 2 * width], level[half + 2 * width : -half])
            ratio = middle / np.maximum(sides, tiny)
            independent = width / PAD * self.segments * (1 - TAPER / 2) * 2 / np.pi
            sigma = np.log(np.maximum(ratio, tiny)) / np.sqrt(2 / independent)
            looks += LOOKS_OF_A_BAND * ratio.size / width
            k = int(np.argmax(sigma))
            if ratio[k] > 1 + POLICY.bump and (best is None or sigma[k] > best.sigma):
                low_hz = float(self.frequency_hz[k + width])
                amplitude_dps = float(np.sqrt(2 * (middle[k] - sides[k]) * width * bin_hz))
                best = Bump(low_hz, low_hz + width * bin_hz, amplitude_dps, float(sigma[k]), 1.0)
        return None if best is None else replace(best, chance=min(1.0, looks * float(tails.normal(best.sigma))))

    def line_power(self, chance: float) -> float:
        """Mean square in lines that noise produces with a probability below ``chance``, dps^2."""
        lines = self.tail * self.frequency_hz.size < chance
        near = np.any([np.roll(lines, shift) for shift in range(-PAD, PAD + 1)], axis=0)
        bin_hz = float(self.frequency_hz[1] - self.frequency_hz[0]) if self.frequency_hz.size > 1 else 0.0
        return float(np.maximum(self.power[near] - self.level[near], 0).sum() * bin_hz)


def evenly_spaced(residuals: Sequence[Array], times_s: Sequence[Array], rate_hz: float) -> tuple[list[Array], float]:
    """Residuals [n] in deg/s with their means where the times [n], s, leave samples out, and their sampling rate, Hz.

    A line of readings without their gaps has a higher frequency. The sampling rate is the given one, the nominal, where nothing
    is missing. Runs stay as they are of which more than ``MOST_MISSING`` is missing, or whose times jitter.
    """
    found = [_places(t_s) for t_s in times_s]
    steps_s = [step_s for _, step_s in filter(None, found)]
    if not steps_s:
        return list(residuals), rate_hz
    out = []
    for values, places in zip(residuals, found, strict=True):
        if places is not None:
            place = places[0]
            whole = np.full(place[-1] + 1, float(values.mean()))
            whole[place] += (values - values.mean()) * np.sqrt(whole.size / values.size)
            values = whole
        out.append(values)
    return out, 1 / float(np.mean(steps_s))


def _places(t_s: Array) -> tuple[Index, float] | None:
    """The places [n] of samples at times [n], s, among evenly spaced ones of which some are missing, and their interval, s.

    None if none is missing, or too many, or if the samples are not evenly spaced.
    """
    steps = np.diff(t_s)
    if steps.size < 2 or steps.min() <= 0:
        return None
    total = float(np.rint(steps / np.median(steps)).sum())
    step_s = float(t_s[-1] - t_s[0]) / max(total, 1.0)
    place = np.rint((t_s - t_s[0]) / step_s).astype(np.intp)
    some = t_s.size < place[-1] + 1 <= t_s.size / (1 - MOST_MISSING)
    return (place, step_s) if some and np.diff(place).min() > 0 else None


def spectrum(
    residuals: Sequence[Array], rate_hz: float, lowest_hz: float = LOWEST_HZ, count_dps: float = 0.0,
) -> Spectrum:  # fmt: skip
    """Average periodogram of several residuals [n] in deg/s, sampled at ``rate_hz``.

    Each residual is cut into segments. The segments are as long as the shortest residual, but at most ``LONGEST_SAMPLES``. The
    spectrum is empty if the residuals are too short. ``count_dps`` is a count of the readings, whose rounding is noise too.
    """
    empty = np.zeros(0)
    length = min(min((r.size for r in residuals), default=0), LONGEST_SAMPLES)
    if length < LEAST_SAMPLES:
        return Spectrum(empty, empty, empty, empty, empty, 0, length)
    frequency = np.fft.rfftfreq(PAD * length, 1 / rate_hz)
    use = (frequency >= lowest_hz) & (frequency < rate_hz / 2)
    levels = relative_levels(residuals, count_dps=count_dps)
    power = even = _periodograms(residuals, length, rate_hz)[:, use]
    if levels.change:
        even = _periodograms(levels.steadied(residuals), length, rate_hz)[:, use]
    segments = len(power)
    if np.count_nonzero(use) < 8 or not power.any():
        return Spectrum(empty, empty, empty, empty, empty, segments, length)
    frequency_hz: Array = frequency[use].astype(np.float64)
    mean: Array = np.asarray(power.mean(axis=0), dtype=np.float64)
    rounding = count_dps**2 / (6 * rate_hz)
    even = even / _segment_levels(even, rounding)[:, None]
    pooled: Array = np.asarray(even.mean(axis=0), dtype=np.float64)
    looks = as_many(_geometric_means(even))
    smooth = smooth_level(frequency_hz, np.maximum(pooled, NO_POWER), looks, PAD)
    ratio = pooled / smooth.level
    scale = float(np.exp(np.median(np.log(np.maximum(mean, NO_POWER)) - np.log(np.maximum(pooled, NO_POWER)))))
    # the level is Gamma-distributed too: of shape 1 / variance
    tail = np.asarray(tails.f_ratio(ratio, 2 * looks, 2 / np.maximum(smooth.variance, 1e-9)))
    return Spectrum(frequency_hz, mean, smooth.level * scale, ratio, tail, segments, length)


def _periodograms(residuals: Sequence[Array], length: int, rate_hz: float) -> Array:
    """Tapered periodogram of each segment [segments, f], dps^2/Hz."""
    window = _tapered(length)
    gain = rate_hz * float((window**2).sum())
    pieces = [r[start : start + length] for r in residuals for start in range(0, r.size - length + 1, length)]
    out = np.empty((len(pieces), PAD * length // 2 + 1))
    for row, piece in zip(out, pieces, strict=True):
        row[:] = 2 * np.abs(np.fft.rfft((piece - piece.mean()) * window, PAD * length)) ** 2 / gain
    return out


def _tapered(length: int) -> Array:
    """A window [length] of ones whose ends are halves of a cosine, each ``TAPER / 2`` of the whole (Tukey)."""
    to_end = np.minimum(np.arange(length), np.arange(length)[::-1]) / max(TAPER * (length - 1) / 2, 1.0)
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.minimum(to_end, 1.0)))


def _geometric_means(power: Array) -> Array:
    """Geometric mean [segments] of each of the periodograms [segments, f], which a line hardly changes."""
    return np.asarray(np.exp(np.log(np.maximum(power, np.finfo(np.float64).tiny)).mean(axis=1)))


def _segment_levels(power: Array, least: float) -> Array:
    """Relative level of each segment [segments] of periodograms [segments, f]: geometric means, shrunk to their own mean.

    ``least`` is the smallest level of a segment, dps^2/Hz.
    """
    log_level = np.log(_geometric_means(np.maximum(power, least)))
    known = np.pi**2 / 6 * PAD / power.shape[1]  # variance of the mean logarithm of exponential variables
    return np.asarray(np.exp(shrunk(log_level - log_level.mean(), known)))
