"""The timing of a reading relative to the true rate: a delay, a filter, or a clock that is fast or slow."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

Array = np.ndarray[Any, np.dtype[np.float64]]

REACH = 1.5
"""Mean steps of the reference. A moment that is further from every sample of the reference has no true rate."""
FORGOTTEN = 1e-5
"""Fraction of the motion to which a filter's memory of the time before the first sample has decayed."""
WIDTHS = (1.0, 1.4, 2.0, 2.8, 4.0, 5.7, 8.0, 11.3, 16.0)
"""Bandwidths of the spline that smooths the reference, in steps of it."""
NEGLIGIBLE_NOISE = 2e-3
"""Noise of the reference that needs no smoothing, as a fraction of the motion's change from sample to sample."""
LARGEST_LOSS = 0.3
"""Largest loss of a twice-smoothed motion, as a fraction of the error that the reference's noise gives a scale."""
FAITHFUL_TIMES = 3
"""So often the smoothing spline of a measured angle smooths."""
FAITHFUL_WIDTHS = 2.0 ** np.arange(0.0, 4.01, 0.125)
"""Its widths, in steps. The first takes nothing below a fifteenth of the rate at which the angle is measured."""
ALIKE, OF_MOTION = 5, 8.0
"""Neighbouring frequencies over which the mean power is motion, and its least ratio to noise. Beats of a coarse encoder's steps
with the sampling are narrower or weaker."""
KEPT_FILTERS = 4
STEP = 0.01
"""Relative step of the numerical derivative by the filter's time constant."""


@dataclass(frozen=True)
class Timing:
    """A reading at time t, counted from the run's first sample, shows the rate of the time ``(1 + clock) t - delay_s``.

    That rate has passed a first-order low-pass with the time constant ``filter_s`` (s); 0 = none.
    """

    delay_s: float = 0.0
    filter_s: float = 0.0
    clock: float = 0.0


SYNCHRONOUS = Timing()


@dataclass(frozen=True)
class _Polynomials:
    """A cubic spline at times [n]: the number of each time's piece, the time since that began, value and derivatives, [n]."""

    piece: np.ndarray[Any, np.dtype[np.intp]]
    since_s: Array
    rate_dps: Array
    first: Array
    second: Array
    third: Array


@dataclass(frozen=True)
class Motion:
    """The true rate between the samples of its reference: a cubic spline through the smoothed samples.

    ``known_s`` [k] and ``known_dps`` [k] are the times (s) and values (deg/s) of the reference.
    """

    known_s: Array
    known_dps: Array
    twice: bool = False
    """True if the bandwidth is the best one for a motion smoothed twice (:func:`smooth`)."""

    @cached_property
    def _spline(self) -> CubicSpline:
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.known_s, smooth(self.known_s, self.known_dps, self.twice))

    @property
    def _reach_s(self) -> float:
        return REACH * float(self.known_s[-1] - self.known_s[0]) / (self.known_s.size - 1)

    def _moment_s(self, t_s: Array, timing: Timing) -> Array:
        start = t_s[0]
        return np.asarray(start + (1 + timing.clock) * (t_s - start) - timing.delay_s)

    def _moment_within_s(self, t_s: Array, timing: Timing) -> Array:
        return np.clip(
            self._moment_s(t_s, timing), self.known_s[0] - self._reach_s, self.known_s[-1] + self._reach_s
        )

    def reached(self, t_s: Array, timing: Timing) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """True for the samples at ``t_s`` [n] that show a moment at which the reference was recorded."""
        at_s = self._moment_s(t_s, timing)
        after = np.clip(np.searchsorted(self.known_s, at_s), 1, self.known_s.size - 1)
        nearest_s = np.minimum(np.abs(at_s - self.known_s[after - 1]), np.abs(at_s - self.known_s[after]))
        recorded = nearest_s <= self._reach_s
        return recorded & (at_s >= self.known_s[0] + self._forgotten_s(timing.filter_s)) if timing.filter_s > 0 else recorded

    def _forgotten_s(self, tau_s: float) -> float:
        """The time after which a low-pass has forgotten the unknown motion before the first sample, s."""
        third = 6 * self._spline.c[0]
        unknown = tau_s**3 * float(np.sqrt(np.mean(third**2)))
        return tau_s * max(0.0, float(np.log(unknown / (FORGOTTEN * float(np.std(self.known_dps)) + 1e-300) + 1e-300)))

    def rate_dps(self, t_s: Array, timing: Timing = SYNCHRONOUS) -> Array:
        """The rate that samples at ``t_s`` [n] show, deg/s. The nearest recorded moment stands for one without a reference."""
        at_s = self._moment_within_s(t_s, timing)
        return self._filtered_dps(self._polynomials(at_s), timing.filter_s) if timing.filter_s > 0 else self._spline(at_s)

    def by_delay(self, t_s: Array, timing: Timing) -> Array:
        """Derivative of :meth:`rate_dps` by ``delay_s``, deg/s^2."""
        at_s = self._moment_within_s(t_s, timing)
        if timing.filter_s > 0:
            at = self._polynomials(at_s)
            return np.asarray((self._filtered_dps(at, timing.filter_s) - at.rate_dps) / timing.filter_s)
        return np.asarray(-self._spline(at_s, 1))

    def by_clock(self, t_s: Array, timing: Timing) -> Array:
        """Derivative of :meth:`rate_dps` by ``clock``, deg/s."""
        return -(t_s - t_s[0]) * self.by_delay(t_s, timing)

    def by_filter(self, t_s: Array, timing: Timing) -> Array:
        """Derivative of :meth:`rate_dps` by ``filter_s``, deg/s^2."""
        step_s = STEP * max(timing.filter_s, self._reach_s)
        low_s, high_s = max(timing.filter_s - step_s, 0.0), timing.filter_s + step_s
        at = self._polynomials(self._moment_within_s(t_s, timing))
        low_dps = self._filtered_dps(at, low_s) if low_s > 0 else at.rate_dps
        return np.asarray((self._filtered_dps(at, high_s) - low_dps) / (high_s - low_s))

    def _polynomials(self, at_s: Array) -> _Polynomials:
        """The spline's pieces at times [n], s, as one search for all of its derivatives."""
        piece = np.clip(np.searchsorted(self.known_s, at_s, side="right") - 1, 0, self.known_s.size - 2)
        since_s = at_s - self.known_s[piece]
        third, half, slope, rate = self._spline.c[:, piece]
        return _Polynomials(
            piece, since_s, rate + since_s * (slope + since_s * (half + since_s * third)),
            slope + since_s * (2 * half + since_s * (3 * third)), 2 * half + since_s * (6 * third), 6 * third,
        )  # fmt: skip

    def _filtered_dps(self, at: _Polynomials, tau_s: float) -> Array:
        """The rate behind a first-order low-pass, exact for the spline.

        In each piece of the spline the solution of ``x + tau x' = w`` is a cubic polynomial plus a decaying exponential.
        Before the first sample the filter is taken to follow the first piece.
        """
        steady = at.rate_dps - tau_s * (at.first - tau_s * (at.second - tau_s * at.third))
        fading = np.where(at.since_s >= 0, np.exp(-np.maximum(at.since_s, 0.0) / tau_s), 1.0)
        return np.asarray(steady + self._excess_dps(tau_s, int(at.piece.max()) + 1)[at.piece] * fading)

    def _excess_dps(self, tau_s: float, pieces: int) -> Array:
        """The size of the exponential at the start of each of the first ``pieces``, kept for the last time constants."""
        from scipy.linalg import solve_banded

        kept: dict[float, Array] = self.__dict__.get("_excess", {})
        excess = kept.get(tau_s)
        if excess is None or excess.size < pieces:
            jump = 6 * tau_s**3 * np.diff(self._spline.c[0, :pieces])  # of the third derivative from piece to piece
            bands = np.zeros((2, pieces))
            bands[0], bands[1, :-1] = 1.0, -np.exp(-np.diff(self.known_s[:pieces]) / tau_s)
            excess = np.asarray(solve_banded((1, 0), bands, np.concatenate([[0.0], jump])))
            others = [(tau, values) for tau, values in kept.items() if tau != tau_s]
            self.__dict__["_excess"] = dict([*others[1 - KEPT_FILTERS :], (tau_s, excess)])  # replaced, as threads share it
        return excess


def smooth(t_s: Array, values: Array, twice: bool = False) -> Array:
    """A noisy reference [n] at times [n], s, smoothed by a cubic smoothing spline of the best width (:func:`best_width`)."""
    return smooth_by(t_s, values, best_width(t_s, values, noise_sd(t_s, values), twice))


def smooth_by(t_s: Array, values: Array, width: float, times: int = 2) -> Array:
    """A reference [n] at times [n], s, smoothed by a spline of a width in mean steps; of width 0, it is left as it is.

    A spline of the width h takes the part ``(2 pi f h)^4`` from a motion of the frequency f, which is as much as the scale of a
    good sensor is off. The residual is smoothed too and added (Tukey's twicing), so only the square of that part is lost; with
    three ``times``, only its third power.
    """
    if width == 0:
        return values
    out = np.zeros_like(values)
    for _ in range(times):
        out = out + _spline_of(t_s, values - out, width)
    return out


def faithful_width(t_s: Array, values: Array, sd: float) -> float:
    """The width, in mean steps, of the widest spline that takes nothing from the motion, if it smooths ``FAITHFUL_TIMES``.

    ``values`` [n] are a motion at times [n], s, with the noise ``sd``. What is lost of the motion, its sum of squares, is less
    than the variance of one value's noise: no estimate from these values is then off by more than one of its standard errors.
    The width with the least error of a value loses many times that, as it holds the loss against the noise of all values.
    """
    n = values.size
    if sd <= NEGLIGIBLE_NOISE * float(np.std(np.diff(values))):
        return 0.0
    even_s = np.linspace(t_s[0], t_s[-1], n)
    motion = np.interp(even_s, t_s, values)
    motion -= np.linspace(motion[0], motion[-1], n)
    window = np.hanning(n)
    power = np.abs(np.fft.rfft(motion * window))[1:] ** 2 / float(window @ window) / sd**2
    turn = 2 * np.pi * np.fft.rfftfreq(n)[1:]
    seen = np.convolve(power, np.full(ALIKE, 1 / ALIKE), "same") > OF_MOTION
    best = float(FAITHFUL_WIDTHS[0])
    for width in FAITHFUL_WIDTHS[1:]:
        fast = (width * turn[seen]) ** 4
        if 2 * float(((fast / (1 + fast)) ** (2 * FAITHFUL_TIMES) * power[seen]).sum()) > 1.0:
            break
        best = float(width)
    return best


def best_width(t_s: Array, values: Array, sd: float, twice: bool = False) -> float:
    """The width, in mean steps, of the spline that smooths a reference [n] at times [n], s, with the noise ``sd`` best.

    It is the one with the least expected error by Mallows' criterion, ``mean square of the residual + 2 sd^2 c``, where c is a
    sample's weight in its own smoothed value. A reference whose noise is far below what the
    motion does from sample to sample is left as it is. With ``twice``, the width is the best one for a motion smoothed twice;
    it is wider, and one that takes a significant part of the motion is not used.
    """
    if sd <= NEGLIGIBLE_NOISE * float(np.std(np.diff(values))):
        return 0.0
    best, least = 0.0, 2 * sd**2
    for width in WIDTHS:
        trial = smooth_by(t_s, values, width) if twice else _spline_of(t_s, values, width)
        weight = 1 / (8**0.5 * width)  # of the equivalent kernel
        if twice:
            taken = float((values - trial) @ trial) - 0.273 * weight * values.size * sd**2  # the last: of noise alone
            if taken > LARGEST_LOSS * sd * float(np.sqrt(trial @ trial)):
                break
            weight = 1.25 * weight
        risk = float(np.mean((values - trial) ** 2)) + 2 * sd**2 * weight
        if risk < least:
            best, least = width, risk
    return best


def _spline_of(t_s: Array, values: Array, width: float) -> Array:
    step_s = float(t_s[-1] - t_s[0]) / (t_s.size - 1)
    return smoothing_spline(t_s, values, (width * step_s) ** 4 / step_s)


def between(known_s: Array, values: Array, t_s: Array, gap_s: float) -> Array:
    """Samples [k] of a smooth motion at ``known_s``, s, at other times ``t_s`` [n]; NaN outside of them and in gaps.

    A cubic spline passes through the samples on each side of a gap. Lines between them would take ``(pi f step)^2 / 3`` from
    a motion of the frequency f.
    """
    from scipy.interpolate import CubicSpline

    out = np.full(t_s.size, np.nan)
    for piece in np.split(np.arange(known_s.size), np.flatnonzero(np.diff(known_s) >= gap_s) + 1):
        first, last = known_s[piece[[0, -1]]]
        inside = (t_s >= first) & (t_s <= last)
        out[inside] = CubicSpline(known_s[piece], values[piece])(t_s[inside]) if piece.size > 1 else values[piece]
    return out


def smoothing_spline(t_s: Array, values: Array, penalty: float) -> Array:
    """The cubic spline with the least ``sum of squared residuals + penalty * integral of the squared second derivative``, [n].

    Source: Reinsch, Numer. Math. 10 (1967) 177. The second derivatives solve an equation of five bands.
    """
    from scipy.linalg import solveh_banded

    steps = np.diff(t_s)
    before, after = 1 / steps[:-1], 1 / steps[1:]
    bands = np.zeros((3, steps.size - 1))
    bands[2] = (steps[:-1] + steps[1:]) / 3 + penalty * (before**2 + (before + after) ** 2 + after**2)
    bands[1, 1:] = steps[1:-1] / 6 - penalty * before[1:] * (before[:-1] + 2 * before[1:] + after[1:])
    bands[0, 2:] = penalty * after[:-2] * before[2:]
    curvature = solveh_banded(bands, np.diff(np.diff(values) / steps))
    pulled = np.zeros(values.size)
    pulled[:-2] += before * curvature
    pulled[1:-1] -= (before + after) * curvature
    pulled[2:] += after * curvature
    return np.asarray(values - penalty * pulled)


def noise_sd(t_s: Array, values: Array) -> float:
    """The white noise of samples [n] of a smooth motion at times [n], s: how far each is off its six neighbours' polynomial."""
    n = values.size
    around = (-3, -2, -1, 1, 2, 3)
    if n < 2 * len(around):
        return 0.0
    middle = slice(3, n - 3)
    times = [t_s[3 + k : n - 3 + k] for k in around]
    weights = [
        np.prod([(t_s[middle] - other) / (mine - other) for other in times if other is not mine], axis=0) for mine in times
    ]
    off = values[middle] - sum(w * values[3 + k : n - 3 + k] for w, k in zip(weights, around, strict=True))
    return float(np.sqrt(np.mean(off**2 / (1 + np.sum(np.square(weights), axis=0)))))
