"""The noise of a measured column, estimated above the band of its motion, and the column smoothed as far as that noise asks.

A reference's rate or a thermometer's reading is a smooth motion plus noise. A window of samples is replaced by a parabola as
long as the parabolas of all shorter windows about the same sample agree with it within their noise (intersection of
confidence intervals; Goldenshluger and Nemirovski, Math. Methods Stat. 6 (1997) 135). The window of half that width is
used, in which a parabola's own error is far below the noise. A plateau is thereby averaged over half of its length or more and
a fast motion is left as it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from gyrocal.recording.stretches import stretches

Array = np.ndarray[Any, np.dtype[np.float64]]

SEGMENT = 256
"""Most samples of a segment of the spectrum. Steps of the motion spoil the few segments that hold them."""
LEAST_SAMPLES = 64
"""Fewer samples have no spectrum; their noise is estimated from third differences."""
ABOVE = 0.3
"""Fraction of the sampling rate from which up to one half the noise is estimated."""
SIGNIFICANT = 4.0
"""Standard errors that count as significant: of a fall of the level between the halves of that band, and of a lost motion."""
AGREE = 3.0
"""Standard errors within which the parabolas of a shorter and a longer window agree."""
HIDDEN = 4.0
"""Standard errors of a smoothed value below which it may be zero."""
AT_REST = 20
"""So many values in a row that may be zero are a rest, and not the moment at which a swing turns back."""
LARGEST_CHANGE = 1e-3
"""Fraction of the motion. A window that removes significantly more over the whole run is too long."""
TURNS_BACK = 0.25
"""Fraction of a thermometer's steps that undo the step before, above which noise decides between two codes."""
SECOND_S = 1.0
"""Heat needs longer than this to pass through a package: temperatures are smoothed from their means over this time, s."""
SLOPE_OF_SPLINE, VALUE_OF_SPLINE = 0.249, 0.393
"""Variances of the slope and of the value of a spline that smooths three times, for a width of one step: ``1 / pi`` times the
integral of ``(w H(w))^2`` and of ``H(w)^2`` over w > 0, with the spline's part ``H = 1 - (1 - 1 / (1 + w^4))^3`` of a motion of
the frequency w / width."""
LONGEST_LINE_S = 1.0
DIRECT = 129
"""Values of a window up to which a direct convolution is faster than a Fourier transform."""
STRETCH = 32
"""Third differences of a stretch whose mean square is taken between the starts and stops of a motion."""
THIRDS_ALIKE = 2.31
"""Sum of the squared autocorrelations of third differences of white noise: so many make one independent value."""
MEDIAN_SPREAD = 1.2533
"""Standard error of a median over that of a mean."""
BLACKMAN_HARRIS = (0.35875, -0.48829, 0.14128, -0.01168)
"""A taper whose leakage is 92 dB down: a swing of 50 deg/s leaks less than 2 mdps."""


@dataclass(frozen=True)
class NoiseLevel:
    """The white noise of one reading: its standard deviation, and the standard error of its square as a fraction of it.

    ``estimated`` is False if the motion reaches up to half the sampling rate. ``sd`` is then an upper bound, unless it was
    stated by the user.
    """

    sd: float
    relative_se: float
    estimated: bool = True
    stated: bool = False

    @property
    def uncertainty(self) -> float:
        """The standard error of the noise's variance as a fraction of it. Of an upper bound, all may be wrong."""
        return self.relative_se if self.estimated or self.stated else 1.0


@dataclass(frozen=True)
class Smoothed:
    """A column without its noise: ``values`` [n], the variance ``error`` [n] that is left in each, and the noise removed.

    Of the slopes of an angle, ``of_angle`` [n] is the variance that is left in the angle, in the slope's unit times a sample.
    """

    values: Array
    error: Array
    noise: NoiseLevel
    of_angle: Array | None = None

    def error_of_means(self, samples: float) -> Array:
        """The variance [n] that the noise leaves in a mean over ``samples`` values about each value.

        The mean of many slopes has the noise of two angles, and that of few has the noise of a slope.
        """
        if self.of_angle is None:
            return np.minimum(self.error, self.noise.sd**2 / samples)
        both = 2 * self.of_angle
        return both * self.error / np.maximum(both + samples**2 * self.error, np.finfo(np.float64).tiny)

    def at_rest(self) -> Smoothed:
        """The same column, zero for ``AT_REST`` or more successive values that do not differ from zero by more than noise."""
        hidden = self.values**2 < HIDDEN**2 * self.error
        start, length = stretches(hidden)
        for first, count in zip(start[length < AT_REST], length[length < AT_REST], strict=True):
            hidden[first : first + count] = False
        return Smoothed(np.where(hidden, 0.0, self.values), np.where(hidden, 0.0, self.error), self.noise)

    def at_most(self, same: Array) -> Smoothed:
        """The same column with no more noise than another sensor's readings ``same`` [n] of the motion leave of it.

        The noise is otherwise taken from the spectrum, and a motion as fast as the samples allow is noise by that.
        """
        known = np.isfinite(self.values)
        beside = _beside(self.values[known], same[known])
        if beside is None:
            return self
        left = float(np.mean(beside**2))
        noise = float(np.mean(self.error[known][np.isfinite(same[known])]))
        if noise <= left * (1 + SIGNIFICANT * self.noise.relative_se):
            return self
        part = left / noise
        level = replace(self.noise, sd=self.noise.sd * part**0.5, estimated=False)
        return Smoothed(self.values, part * self.error, level, None if self.of_angle is None else part * self.of_angle)

    def at(self, t_s: Array, known_s: Array) -> Smoothed:
        """The column at the times ``t_s`` [m], by interpolation between the times ``known_s`` [n] that have a reading."""
        values, error, of_angle = (
            None if column is None else np.interp(t_s, known_s, column) for column in (self.values, self.error, self.of_angle)
        )
        assert values is not None
        assert error is not None
        return Smoothed(values, error, self.noise, of_angle)


def smoothed(values: Array, stated_sd: float | None = None, same: Array | None = None) -> Smoothed:
    """An evenly sampled column [n] smoothed. Samples that hold the previous value count as one reading.

    ``stated_sd`` is the noise that the user states; it is used only where the noise cannot be estimated. A column whose
    noise is neither estimated nor stated is not smoothed. ``same`` [n] is another sensor's reading of the same motion, which
    bounds the noise: steps from one set point to the next are noise by their spectrum, but that sensor shows them too.
    """
    readings, which = _held(values)
    noise = noise_level(readings)
    if same is not None:
        first = np.flatnonzero(np.diff(which, prepend=-1))
        noise = _at_most(noise, readings, same[first])
    if not noise.estimated and stated_sd is not None:
        noise = NoiseLevel(stated_sd, 0.0, estimated=False, stated=True)
    centre = float(readings.mean())
    unknown = not noise.estimated and stated_sd is None
    chosen, own = _widest(readings - centre, 0.0 if unknown else noise.sd)
    return Smoothed((chosen + centre)[which], (noise.sd**2 * own)[which], noise)


def smoothed_temperature(temp_c: Array, t_s: Array, stated_sd_c: float | None = None) -> Smoothed:
    """A thermometer's readings [n], degC, at times [n], s, smoothed.

    A thermometer that moves in single steps less often than once a second has no noise to average: the temperature is half
    way between two codes when it passes from one to the other, and on a line between two such times.
    """
    start = np.flatnonzero(np.diff(temp_c)) + 1
    moved_c = temp_c[start] - temp_c[start - 1]
    step_c = np.abs(moved_c)
    stairs = start.size > 1 and float(step_c.max()) <= 1.5 * float(step_c.min())
    stairs = stairs and float(np.mean(np.diff(np.sign(moved_c)) != 0)) <= TURNS_BACK
    if stairs and (t_s[-1] - t_s[0]) / start.size > SECOND_S:
        at_s, between_c = (t_s[start] + t_s[start - 1]) / 2, (temp_c[start] + temp_c[start - 1]) / 2
        sd_c = float(step_c.min()) / 12**0.5
        last_c = np.clip(_line(t_s, at_s, between_c), temp_c - step_c.min() / 2, temp_c + step_c.min() / 2)
        return Smoothed(last_c, np.full(t_s.size, sd_c**2 / start.size**2), NoiseLevel(sd_c, 0.0))
    first = np.flatnonzero(np.diff(np.floor((t_s - t_s[0]) / SECOND_S), prepend=-1.0))
    count = np.diff(first, append=t_s.size)
    at_s, mean_c = np.add.reduceat(t_s, first) / count, np.add.reduceat(temp_c, first) / count
    typical = float(np.median(count))
    of_means = smoothed(mean_c, None if stated_sd_c is None else stated_sd_c / typical**0.5)
    return Smoothed(
        _line(t_s, at_s, of_means.values), np.interp(t_s, at_s, of_means.error),
        replace(of_means.noise, sd=of_means.noise.sd * typical**0.5),
    )  # fmt: skip


def _line(t_s: Array, at_s: Array, values: Array) -> Array:
    """Linear interpolation, and beyond the ends the line through the first or last two values."""
    if at_s.size < 2:
        return np.full(t_s.size, float(values[0]))
    slope = np.diff(values)[[0, -1]] / np.diff(at_s)[[0, -1]]
    out = np.interp(t_s, at_s, values)
    out += slope[0] * np.minimum(t_s - at_s[0], 0.0) + slope[1] * np.maximum(t_s - at_s[-1], 0.0)
    return out


def noise_level(values: Array) -> NoiseLevel:
    """The white noise of readings [n] from the median spectrum of their segments between 0.3 and 0.5 of the sampling rate."""
    n = values.size
    if n < 5:
        return NoiseLevel(0.0, 0.0)
    if n < LEAST_SAMPLES:
        third = np.diff(values, 3)
        return NoiseLevel(float(np.sqrt(np.mean(third**2) / 20)), float(np.sqrt(4.6 / third.size)))
    size = min(SEGMENT, 2 ** int(np.log2(n / 4)))
    count = n // size
    angle = 2 * np.pi * np.arange(size) / size
    window = sum(a * np.cos(k * angle) for k, a in enumerate(BLACKMAN_HARRIS))
    parts = values[: count * size].reshape(count, size)
    power = np.abs(np.fft.rfft((parts - parts.mean(axis=1, keepdims=True)) * window)[:, int(ABOVE * size) : size // 2]) ** 2
    power /= np.sum(np.square(window))
    half = power.shape[1] // 2
    lower, upper = (_typical(part) for part in (power[:, :half], power[:, half:]))
    scatter = np.sqrt(4 / (half * count))  # of the level of one half, relative; two bins are one independent value
    falling = lower > upper * (1 + SIGNIFICANT * scatter)
    level = upper if falling else _typical(power)
    quiet = _between_starts(values)
    if not falling and level > quiet.sd**2 * (1 + SIGNIFICANT * np.hypot(scatter, quiet.relative_se)) > 0:
        return quiet
    return NoiseLevel(float(np.sqrt(level)), float(scatter), estimated=not falling)


def _at_most(noise: NoiseLevel, readings: Array, same: Array) -> NoiseLevel:
    """The noise of readings [n], or as its upper bound what another sensor's readings [n] leave of them, if that is less."""
    beside = _beside(readings, same)
    if beside is None:
        return noise
    left = noise_level(beside)
    less = noise.sd**2 > left.sd**2 * (1 + SIGNIFICANT * np.hypot(noise.relative_se, left.relative_se))
    return replace(left, estimated=False) if less else noise


def _beside(values: Array, same: Array) -> Array | None:
    """What another sensor's readings ``same`` [n], NaN where missing, leave of values [n]; None where they tell nothing."""
    known = np.isfinite(same)
    if known.sum() < 5 or np.ptp(same[known]) == 0:
        return None
    columns, values = np.column_stack([np.ones(same.size), same])[known], values[known]
    return np.asarray(values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0])


def _between_starts(values: Array) -> NoiseLevel:
    """The white noise of readings [n] from the third differences of short stretches, most of which hold no faster motion.

    A turn by hand starts and stops with a kink, whose spectrum reaches through the band in every segment that holds one. The
    median is that of the stretches' mean squares: that of single differences of coarse counts would be a whole count.
    """
    third = np.diff(values, 3)
    count = third.size // STRETCH
    power = np.mean(third[: count * STRETCH].reshape(count, STRETCH) ** 2, axis=1)
    freedom = STRETCH / THIRDS_ALIKE
    level = float(np.median(power)) / (1 - 2 / (9 * freedom)) ** 3 / 20
    return NoiseLevel(level**0.5, float(MEDIAN_SPREAD * np.sqrt(2 / freedom / count)))


class Slopes(NamedTuple):
    """Slopes [n] of an angle, their variance [n], and that of the angle [n] itself."""

    values: Array
    error: Array
    of_angle: Array


def steadier_slope(t_s: Array, values: Array, sd: float, slope: Array, width: float) -> Slopes:
    """Slopes of a noisy angle [n] at times [n], s, with less noise than those of its smoothing spline.

    ``sd`` is the noise of the angle, and ``slope`` [n] and ``width`` are slope and bandwidth of the spline
    (:func:`gyrocal.recording.timing.faithful_width`).
    Where lines over windows that grow as in :func:`smoothed` agree with it, theirs is taken. Uneven steps are made even first.
    """
    even_s = np.linspace(t_s[0], t_s[-1], t_s.size)
    step_s = float(even_s[1] - even_s[0])
    x, chosen = np.interp(even_s, t_s, values), np.interp(even_s, t_s, slope)
    of_chosen = np.full(x.size, SLOPE_OF_SPLINE * (sd / step_s) ** 2 / max(width, 1.0) ** 3)
    of_angle = np.full(x.size, VALUE_OF_SPLINE * sd**2 / max(width, 1.0))
    widest, of_widest, of_its_angle = chosen, of_chosen, of_angle
    low, high = chosen - AGREE * of_chosen**0.5, chosen + AGREE * of_chosen**0.5
    growing, size = np.full(x.size, sd > 0), 3
    while growing.any() and size <= min(x.size, round(LONGEST_LINE_S / step_s)):
        half = size // 2
        numbers = np.arange(-half, half + 1.0)
        squares = float(numbers @ numbers)
        variance = (sd / step_s) ** 2 / squares
        if variance < of_chosen[0] / 2:
            line = np.full(x.size, np.nan)
            line[half : x.size - half] = np.convolve(x, numbers[::-1], mode="valid") / (squares * step_s)
            low, high = np.fmax(low, line - AGREE * variance**0.5), np.fmin(high, line + AGREE * variance**0.5)
            growing &= (low <= high) & np.isfinite(line)
            chosen, of_chosen = np.where(growing, widest, chosen), np.where(growing, of_widest, of_chosen)
            of_angle = np.where(growing, of_its_angle, of_angle)
            widest, of_widest = np.where(growing, line, widest), np.where(growing, variance, of_widest)
            of_its_angle = np.where(growing, sd**2 / size, of_its_angle)
        size = 2 * size - 1
    return Slopes(*(np.interp(t_s, even_s, column) for column in (chosen, of_chosen, of_angle)))


def _typical(power: Array) -> float:
    """The median over segments of a band's mean power [segments, bins], as an unbiased mean of gamma variables."""
    freedom = power.shape[1]  # two degrees of freedom a bin, and two bins are one independent value
    return float(np.median(power.mean(axis=1)) / (1 - 2 / (9 * freedom)) ** 3)


def _held(values: Array) -> tuple[Array, np.ndarray[Any, np.dtype[np.intp]]]:
    """Readings of a column whose samples repeat each reading equally often, and the reading [n] that each sample holds."""
    n = values.size
    start = np.flatnonzero(np.concatenate([[True], np.diff(values) != 0]))
    length = np.diff(start, append=n)
    typical = float(np.median(length)) if length.size else 1.0
    if typical < 2 or length.size < 5 or float(np.mean(np.abs(length - typical) <= 1)) < 0.8:
        return values, np.arange(n)
    return values[start], np.repeat(np.arange(start.size), length)


def _widest(x: Array, sd: float) -> tuple[Array, Array]:
    """Each value [n] from half of the widest window that agrees with all narrower ones, and its own weight [n] in it."""
    n = x.size
    chosen, own = x.copy(), np.ones(n)
    widest, of_widest = chosen, own
    low, high = x - AGREE * sd, x + AGREE * sd
    growing = np.ones(n, dtype=bool)
    size = 5
    while sd > 0 and size <= n:
        fit, weight = _parabola(x, size)
        error = AGREE * sd * np.sqrt(weight)
        low, high = np.maximum(low, fit - error), np.minimum(high, fit + error)
        growing &= low <= high
        trial = np.where(growing, fit, widest)
        power = float(trial @ trial)
        if abs(float((x - trial) @ trial)) > LARGEST_CHANGE * power + SIGNIFICANT * sd * power**0.5:
            break
        chosen, own = np.where(growing, widest, chosen), np.where(growing, of_widest, own)
        widest, of_widest = trial, np.where(growing, weight, of_widest)
        if not growing.any():
            break
        size = 2 * size - 1
    return chosen, own


def _parabola(x: Array, size: int) -> tuple[Array, Array]:
    """The parabola fitted to ``size`` values about each value (at the ends: the first or last), and each one's own weight [n].

    The own weight is also the variance of the fitted value as a fraction of that of a reading.
    """
    half = size // 2
    basis = np.linalg.qr(np.vander(np.linspace(-1, 1, size), 3))[0]
    weight = np.empty(x.size)
    fit = np.empty(x.size)
    of_window = np.einsum("ij,ij->i", basis, basis)
    fit[half : x.size - half] = convolved(x, basis @ basis[half])
    weight[half : x.size - half] = of_window[half]
    fit[:half] = basis[:half] @ (basis.T @ x[:size])
    fit[x.size - half :] = basis[size - half :] @ (basis.T @ x[-size:])
    weight[:half], weight[x.size - half :] = of_window[:half], of_window[size - half :]
    return fit, weight


def convolved(x: Array, window: Array) -> Array:
    """The convolution of values [n] with a shorter window [m], where the window is within them, [n - m + 1]."""
    from scipy.fft import irfft, next_fast_len, rfft

    if window.size <= DIRECT:
        return np.convolve(x, window, mode="valid")
    size = next_fast_len(x.size, real=True)  # what goes around the end falls on values that are left out
    return np.asarray(irfft(rfft(x, size) * rfft(window, size), size)[window.size - 1 : x.size])
