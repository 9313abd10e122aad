"""Rates as the slopes of measured angles: of an encoder's angle, or of the rotations between a tracker's orientations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from gyrocal.policy import POLICY
from gyrocal.recording.orientation import count_deg, jumps
from gyrocal.recording.smoothing import SLOPE_OF_SPLINE, NoiseLevel, Smoothed, steadier_slope
from gyrocal.recording.timing import FAITHFUL_TIMES, faithful_width, noise_sd, smooth_by
from gyrocal.tails import ROBUST

Array = np.ndarray[Any, np.dtype[np.float64]]
Mask = np.ndarray[Any, np.dtype[np.bool_]]
Index = np.ndarray[Any, np.dtype[np.intp]]

TRIMMED = 5
"""Samples at each end of a stretch of angles whose slope is not relied on, at the least."""
STRAIGHT = 10.0
"""Nearer than this to an end, in its own widths, the spline is too straight, because its second derivative is zero there."""
LONGEST_END = 0.02
"""Part of a stretch at each end whose slope is not relied on, at the most. In short stretches the spline is narrower."""
GAP_STEPS = 3.5
"""An angle that is missing for more of its usual steps than this gives no rate in between."""
SEGMENT, LEAST_SEGMENT = 256, 64
"""Samples of a segment of the spectrum. Shorter angles have no spectrum; their noise is estimated from differences."""
OCTAVE_PART, OCTAVE = 2 ** (1 / 3), 3
"""The spectrum's bands are thirds of an octave, so many of which make one."""
LOWEST = 4
"""The first value of a segment's spectrum that is used."""
FLAT = 2.0
"""The spectrum is flat where the levels of its bands differ by less than this factor."""
RISES = 4.0
"""Below that octave, the level of a tracker's noise rises by up to this factor. The motion then rises by more."""
OF_MOTION = 0.1
"""Noise is below this part of the motion. A motion whose spectrum is flat up to some frequency exceeds it."""
NEIGHBOURS = 24
"""Samples over which the noise of angles is compared."""
LEAST_HELD, HELD_ALIKE = 20, 0.8
"""An angle is held if it changes at least so often, and this part of the times between changes differ by at most a sample."""
SEVERAL, SOMETIMES = 1.5, 0.1
"""A held angle moves by more than so many counts at a time, or it stays the same in more than this part of its readings."""
SHORT, ROUNDS = 0.1, 3
"""Quantile of the times between changes that is taken for one period at first, and the fits that improve it."""
EVEN, REGULAR = 0.4, 0.1
"""Samples (one sigma) by which changes are off even times. Rounded up to samples, they are off by 0.29; by less than the second
if the angle is measured in a sample itself."""
STEADIER_SE = 0.5
"""Standard error of the variance of a steadier rate, as a fraction of it: a tracker's noise is not the same everywhere."""


class AngleSlopes(NamedTuple):
    """Rates [n, k], deg/s, NaN where there are none; the number of jumps; and what the smooth curves leave of the angles,
    [n, k], deg, NaN where no angle was measured. ``noise_dps`` is the largest noise of the rates, as noise of the angles that
    is white makes it, and ``steadier`` are the rates with less noise, [n, k]. Within ``reach`` samples of a corner of the
    motion the curve is round.
    """

    rates: Array
    jumps: int
    left_deg: Array
    noise_dps: float
    reach: int
    steadier: Smoothed | None

    def noisy(self) -> Mask:
        """True for the angles [n] among neighbours with much more noise than usual: a tracker sees few markers.

        None is, where most of the motion is among them: stamps that jitter add to the noise wherever the sensor turns. Nor is
        one that is as noisy as fast turns are, as of angles that were interpolated, which have no noise at rest.
        """
        rows = np.flatnonzero(np.isfinite(self.left_deg).all(axis=1))
        found = np.zeros(len(self.left_deg), dtype=bool)
        if rows.size < 4 * NEIGHBOURS:
            return found
        beside = (NEIGHBOURS // 2, NEIGHBOURS // 2)
        square = np.cumsum(np.pad(np.sum(self.left_deg[rows] ** 2, axis=1), beside, mode="reflect"))
        level = (square[NEIGHBOURS:] - square[:-NEIGHBOURS])[: rows.size]
        found[rows] = level > POLICY.noisy_times**2 * np.median(level)
        power = np.nansum(self.rates**2, axis=1)
        left_out = max(float(found[rows].mean()), float(power[found].sum()) / (float(power.sum()) or 1.0))
        if left_out > POLICY.lost_most:
            return np.zeros_like(found)
        fast = power[rows] > power[rows].mean()
        found[rows] &= level > POLICY.noisy_times**2 * (np.median(level[fast]) if fast.any() else 0.0)
        return found


def angle_slopes(t_s: Array, known: Mask, turned: Callable[[Index], Array], *, steadier: bool = False) -> AngleSlopes:
    """The rates at times ``t_s`` [n], s; ``turned`` gives the angles from each of m rows to the next, [m - 1, k], deg.

    Rows that are ``known`` [n] have an angle. The rate is the slope of a smooth curve through the sum of the angles, which is
    exact whatever they are, so that the rate's integral is the measured angle. The curve is a smoothing spline
    (:func:`gyrocal.recording.timing.smooth_by`), piece by piece between gaps and jumps. Samples between two angles have a rate
    too: a tracker or an encoder may be slower than the sensor. An angle that is held until the next one counts where it
    changes.
    """
    from scipy.interpolate import CubicSpline

    rows = np.flatnonzero(known)
    anew, late = _measured_anew(turned(rows))
    rows = rows[anew]
    measured_s = np.interp(rows - late, np.arange(t_s.size), t_s)
    steps_deg = turned(rows)
    rates, left_deg, steady, error, of_angle = np.full((5, t_s.size, steps_deg.shape[1]), np.nan)
    steps_s = np.diff(measured_s)
    usual_s = float(np.median(steps_s)) if steps_s.size else 0.0
    jumped = jumps(steps_deg, usual_s / steps_s)
    cuts = np.flatnonzero(jumped | (steps_s > GAP_STEPS * usual_s)) + 1
    pieces = [p for p in np.split(np.arange(rows.size), cuts) if p.size > 2 * TRIMMED]
    times_s = [measured_s[p] for p in pieces]
    angles_deg = [np.cumsum(np.vstack([np.zeros_like(steps_deg[:1]), steps_deg[p[:-1]]]), axis=0) for p in pieces]
    noises_deg = [[angle_noise_deg(t, a) for a in angle.T] for t, angle in zip(times_s, angles_deg, strict=True)]
    widths = _typical(times_s, [
        [faithful_width(t, a, sd) for a, sd in zip(angle.T, of_piece, strict=True)]
        for t, angle, of_piece in zip(times_s, angles_deg, noises_deg, strict=True)
    ])  # fmt: skip
    widest = LONGEST_END / STRAIGHT * _typical(times_s, [[p.size] for p in pieces])[0] if pieces else 0.0
    widths = [min(width, widest) for width in widths]
    sds = _typical(times_s, noises_deg) if pieces else []
    noises = (sd * SLOPE_OF_SPLINE**0.5 / max(width, 1.0) ** 1.5 for sd, width in zip(sds, widths, strict=True))
    noise_dps = max(noises, default=0.0) / (usual_s or 1.0)
    trimmed = max([TRIMMED, *(int(np.ceil(STRAIGHT * width)) for width in widths)])
    reach = round(trimmed * usual_s / float(np.median(np.diff(t_s)))) if t_s.size > 1 else 0
    for piece, at_s, angle_deg in zip(pieces, times_s, angles_deg, strict=True):
        if piece.size <= 2 * trimmed:
            continue
        pairs = zip(angle_deg.T, widths, strict=True)
        curves = np.column_stack([smooth_by(at_s, a, width, FAITHFUL_TIMES) for a, width in pairs])
        slopes = CubicSpline(at_s, curves)
        inner = slice(trimmed, piece.size - trimmed)
        inside = (t_s >= at_s[inner][0]) & (t_s <= at_s[inner][-1])
        rates[inside] = slopes(t_s[inside], 1)
        for k, sd in enumerate(sds if steadier else []):
            found = steadier_slope(at_s, angle_deg[:, k], sd, slopes(at_s, 1)[:, k], widths[k])
            steady[inside, k], error[inside, k], of_angle[inside, k] = (np.interp(t_s[inside], at_s, v) for v in found)
        left_deg[rows[piece[inner]]] = (angle_deg - curves)[inner]
    if not sds or not steadier:
        return AngleSlopes(rates, int(jumped.sum()), left_deg, noise_dps, reach, None)
    inside = np.isfinite(rates).all(axis=1)
    removed = float(np.max(np.median(np.abs(rates[inside] - steady[inside]), axis=0))) * ROBUST
    noise = NoiseLevel(max(removed, float(np.max(np.median(error[inside], axis=0))) ** 0.5), STEADIER_SE)
    of_angle /= float(np.median(np.diff(t_s))) ** 2
    return AngleSlopes(rates, int(jumped.sum()), left_deg, noise_dps, reach, Smoothed(steady, error, noise, of_angle))


def _measured_anew(steps_deg: Array) -> tuple[Index, Array]:
    """The samples [m] at which an angle was measured, and how many samples before, [m], if each is held for some samples.

    ``steps_deg`` [n - 1, k] are the steps of the angle. If it is not held, it is measured in all samples. An angle that is held
    changes at even times, and by several counts at a time or not each time. One that moves by single counts may
    be coarse and no more. While a held angle stands still, it is taken as often as otherwise.
    """
    moved = np.linalg.norm(steps_deg, axis=1)
    every = np.arange(moved.size + 1)
    start = np.concatenate([[0], np.flatnonzero(moved) + 1])
    length = np.diff(start, append=every.size)
    inner = length[1:-1]
    if start.size < LEAST_HELD or np.median(inner) < 2:
        return every, np.zeros(every.size)
    period = float(np.median(inner[inner <= 1.5 * np.quantile(inner, SHORT)]))
    for _ in range(ROUNDS):
        number = np.concatenate([[0], np.cumsum(np.maximum(np.round(inner / period), 1))])
        period, first = (float(c) for c in np.polyfit(number, start[1:], 1))
    off = start[1:] - first - period * number
    even = float(np.std(off)) < EVEN
    alike = float(np.mean(np.abs(inner - np.median(inner)) <= 1)) >= HELD_ALIKE
    several = float(np.median(moved[start[1:] - 1])) > SEVERAL * count_deg(steps_deg)
    sometimes = float(np.mean(inner > 1.5 * period)) > SOMETIMES
    if period < 2 or not ((alike and several) or (even and (several or sometimes))):
        return every, np.zeros(every.size)
    times = np.maximum(np.round(length / period).astype(int), 1)
    number = np.arange(times.sum()) - np.repeat(np.cumsum(times) - times, times)
    rows = np.minimum(np.repeat(start, times) + np.round(number * period).astype(int), moved.size)
    late = np.full(start.size, 0.5)
    if even:
        late[1:] = np.clip(off + 0.5, 0.0, 1.0) if np.std(off) > REGULAR else 0.0
    kept = slice(0 if length[0] > period - 1 else times[0], None)
    return rows[kept], np.repeat(late, times)[kept]


def _typical(times_s: Sequence[Array], numbers: Sequence[Sequence[float]]) -> list[float]:
    """The median over all samples of a number that the angles of each piece have for each axis, [pieces, k].

    One width of the splines for all leaves noise of one kind. Narrow splines in one piece and wide ones in another would look
    like noise of two levels.
    """
    share = np.repeat(np.arange(len(times_s)), [t.size for t in times_s])
    return [float(np.sort(column[share])[share.size // 2]) for column in np.array(numbers).T]


def angle_noise_deg(t_s: Array, angle_deg: Array) -> float:
    """The noise of measured angles [n] at times [n], s: the standard deviation of white noise of the same density, deg.

    The spectrum of a motion falls with frequency and that of white noise is flat. Angles that were brought from a slower
    tracker's times to those of the sensor have noise below half of the tracker's rate alone. The noise is found at the
    highest octave over which the spectrum is flat, and is its level there or at the frequencies below, where the noise of most
    trackers rises somewhat. Lines do not count.
    """
    size = min(SEGMENT, 2 ** int(np.log2(max(angle_deg.size / 2, 1))))
    steps = np.diff(np.interp(np.linspace(t_s[0], t_s[-1], t_s.size), t_s, angle_deg))
    count = steps.size // size
    if size < LEAST_SEGMENT or not count:
        return noise_sd(t_s, angle_deg)
    window = np.blackman(size)
    parts = steps[: count * size].reshape(count, size)
    power = np.abs(np.fft.rfft((parts - parts.mean(axis=1, keepdims=True)) * window)) ** 2 / (window @ window)
    level = power.mean(axis=0)[1:] / (4 * np.sin(np.pi * np.arange(1, size // 2 + 1) / size) ** 2)
    edges = np.unique(np.round(size / 2 * OCTAVE_PART ** -np.arange(0.0, 12.0)).astype(int))
    edges = edges[edges >= LOWEST]
    bands = np.array([np.median(level[a:b]) for a, b in pairwise(edges)])[::-1]
    for first in range(bands.size - OCTAVE + 1):
        octave = bands[first : first + OCTAVE]
        if octave.max() <= FLAT * octave.min() and octave.min() ** 0.5 < OF_MOTION * float(np.std(angle_deg)):
            ends = np.append(np.flatnonzero(bands[first:] > RISES * octave.min()), bands.size - first)[0]
            return float(bands[first : first + ends].max() ** 0.5)
    return noise_sd(t_s, angle_deg)
