"""Quantities on which effects depend: temperature, time since power-on, acceleration and true rate, and slopes of these.

This file defines no effect. A quantity that a run does not have is None. Missing cells within a column are interpolated.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np

from gyrocal.effects.base import elapsed_s
from gyrocal.policy import POLICY
from gyrocal.recording.once import once_a_run
from gyrocal.recording.outliers import Index, alone
from gyrocal.recording.session import Array, Run
from gyrocal.recording.smoothing import convolved

REFERENCE_C = 25.0
"""Reference temperature of bias and scale."""

TURNING = "a run in which the table turns about this axis at a known rate"
TURNING_OR_TURNED = "a run in which the table turns about this axis at a known rate or by a known angle"
TURNING_AT_ALL = "a run in which the table turns at a known rate"
VARYING_RATE = "a run about this axis whose true rate changes (swing the table), with a rate_ref_dps column"
MOVING_TEMPERATURE = "a temp_c column that moves by 1 °C or more over the session"

LOST_IN_BLOCKS_HZ = 2.5
"""Frequency above which means over blocks of a tenth of a second lose more than a tenth of a wave's amplitude, Hz."""
LEAST_RANGE_C = 1.0
TEMPERATURE_WINDOW_S = 10.0
"""Shortest time over which the slope of the temperature is computed, s. Heat passes through a package in seconds."""
CUBIC = 1 / 6
"""Fraction of the window up to which the noise may need it, so that a cubic is fitted. At the ends, its slope has a hundred
times the variance of that of a line."""
RATE_WINDOW_S = 0.2
"""Time over which the slope of the true rate is computed, s. Encoders are noisy, and tables change their rate slowly."""
LEAST_ACCELERATION_DPS_S = 0.5
"""A reference that changes by less than this (rms, deg/s) counts as a constant rate with encoder noise."""
DECIMALS, EXACT_DPS = 7, 1e-9
"""Decimals of readings that are looked at, and what the arithmetic adds to their rounding, deg/s."""
FEWER_THAN_TWO = 1.5
"""Gaps between readings that are shorter than this many of the shortest are of one step."""
WITHIN_ROUNDING = 1.2
"""Range, in the last decimals, of what readings may be off their multiples: rounding makes one, and the fitted step little."""
NEARBY = 41
"""Steps that are tried about the one by least squares."""
FIRST_MULTIPLES, FEWEST_VALUES = 8, 16
"""A step is fitted to so many of its multiples first, and to so many different readings at least."""


def slope_squared(run: Run) -> Array | None:
    """The square of the slope of the table's rate, shape [n], dps^2/s^2: no known effect. None if no rate is known."""
    return None if run.rate_is_mean or len(run) < 2 else np.asarray(np.gradient(true_rate_dps(run), run.sample_s) ** 2)


def true_rate_dps(run: Run) -> Array:
    """True rate about the run's axis, shape [n], deg/s, without the reference's noise.

    A residual is the reading minus the reference as it was measured, so what is a function of the rate must not have its noise.
    """
    return run.rate_dps if run.smooth_rate is None else run.smooth_rate.values


def rate_noise(run: Run, axis: int, samples: float) -> tuple[Array, float] | None:
    """The noise that smoothing leaves in means of the true rate over ``samples`` samples, [n], as :meth:`Effect.noise`."""
    if run.smooth_rate is None or axis != run.axis_index:
        return None
    return run.smooth_rate.error_of_means(samples), run.smooth_rate.noise.uncertainty


def noise_of_slope_dps(run: Run) -> float:
    """The noise of one sample of a true rate that is the slope of one measured angle, deg/s; 0 of any other rate."""
    return 0.0 if run.measured_rates is None else run.measured_rates.noise_dps


def noise_of_rate_dps(run: Run) -> float:
    """The noise of one sample of the measured true rate, deg/s; 0 if the rate is not measured."""
    return noise_of_slope_dps(run) if run.smooth_rate is None else run.smooth_rate.noise.sd


RATE_STEP_DPS = 1e-3


@once_a_run
def with_faster_rate(run: Run) -> Run:
    """A run whose true rate, without the reference's noise, is higher by ``RATE_STEP_DPS``."""
    return _with_rate_more(run, RATE_STEP_DPS)


@once_a_run
def with_slower_rate(run: Run) -> Run:
    """A run whose true rate, without the reference's noise, is lower by ``RATE_STEP_DPS``."""
    return _with_rate_more(run, -RATE_STEP_DPS)


def _with_rate_more(run: Run, by_dps: float) -> Run:
    assert run.smooth_rate is not None
    other = copy(run)
    other.__dict__.pop("_once", None)
    other.__dict__["smooth_rate"] = replace(run.smooth_rate, values=run.smooth_rate.values + by_dps)
    return other


def temperature_noise(run: Run, samples: float) -> tuple[Array, float] | None:
    """The noise that smoothing leaves in means of the temperature over ``samples`` samples, [n], as :meth:`Effect.noise`."""
    return None if run.smooth_temp is None else (run.smooth_temp.error_of_means(samples), run.smooth_temp.noise.uncertainty)


def rate_about(run: Run, axis: int) -> Array:
    """True rate about an axis, shape [n], deg/s; zero for axes other than the table's."""
    return true_rate_dps(run) if axis == run.axis_index else np.zeros(len(run))


def reading_error_dps(run: Run, axis: int) -> Array:
    """Measured minus the reference's rate about an axis, shape [n], deg/s."""
    return run.gyro_dps[:, axis] - (run.rate_dps if axis == run.axis_index else 0.0)


def sense_of_rotation(run: Run) -> Array:
    """The sign of the true rate, shape [n]; 0 where the noise of the reference exceeds a tenth of it."""
    rate_dps = true_rate_dps(run)
    return np.where(np.abs(rate_dps) > 10 * noise_of_rate_dps(run), np.sign(rate_dps), 0.0)


def turns(runs: Sequence[Run], axis: int) -> bool:
    """True if the table turns about this axis and its rate is known at each sample."""
    return any(r.axis_index == axis and not r.rate_is_mean and bool(np.any(r.rate_dps)) for r in runs)


def turned(runs: Sequence[Run], axis: int) -> list[float]:
    """The directions (1 and -1) of the turns of known angle about this axis, of which the mean rate alone is known.

    An error that is proportional to the rate, or to its size, has the same share of such a turn whatever its course is.
    """
    by_angle = (r.rate_dps[0] for r in runs if r.axis_index == axis and r.rate_is_mean)
    return sorted({float(np.sign(mean_dps)) for mean_dps in by_angle if mean_dps})


def power_on_time_s(run: Run) -> Array | None:
    """Time since power-on, shape [n], s."""
    return None if run.power_on_s is None else run.power_on_s + elapsed_s(run)


def cycle_time_s(run: Run) -> Array:
    """Time since power-on, shape [n], s, but for a constant of the power cycle.

    Where it is not recorded, the runs of the cycle are taken to follow each other without a pause.
    """
    since_s = power_on_time_s(run)
    return elapsed_s(run) + run.earlier_s if since_s is None else since_s


def temperature_c(run: Run) -> Array | None:
    """Temperature, shape [n], degC, without the thermometer's noise."""
    if run.smooth_temp is not None:
        return run.smooth_temp.values
    return None if run.temp_c is None else _filled(run.temp_c, run.t_s)


def warming_c(run: Run) -> Array:
    """Temperature above 25 degC, shape [n], degC; zero where the run has no thermometer."""
    temp_c = temperature_c(run)
    return np.zeros(len(run)) if temp_c is None else temp_c - REFERENCE_C


def acceleration_g(run: Run) -> Array | None:
    """Acceleration, shape [n, 3], g. Single readings of damaged packets or knocks are put back to those beside."""
    if run.acc_g is None:
        return None
    acc_g = np.column_stack([_filled(run.acc_g[:, i], run.t_s) for i in range(3)])
    for i, (rows, apart_g) in enumerate(damaged_accelerations(run)):
        acc_g[rows, i] -= apart_g
    return acc_g


@once_a_run
def damaged_accelerations(run: Run) -> list[tuple[Index, Array]]:
    """For each axis of the accelerometer the rows [k] of damaged packets, and by how much they are off, g."""
    assert run.acc_g is not None
    return [alone(_filled(run.acc_g[:, i], run.t_s), POLICY.motion_g) for i in range(3)]


@once_a_run
def squares_of_tenths(run: Run) -> Array | None:
    """Mean square of the acceleration in each tenth of a run, shape [min(n, 10), 3], g^2."""
    acc_g = acceleration_g(run)
    return None if acc_g is None else means_of_tenths(acc_g**2)


LEAST_TURN_RAD = 0.05
"""Least change of the direction of gravity that is a change of pose, and no drift of the accelerometer."""


def pose_changes(runs: Sequence[Run]) -> bool:
    """True if the direction of the acceleration, as means over seconds show it, changes between or within runs.

    In one pose gravity is constant. What an accelerometer then shows beyond it is its own drift, which follows the temperature
    as a gyroscope's bias does, and nothing can be told to depend on the acceleration.
    """
    found = [means for r in runs if (means := acceleration_by_second(r)) is not None]
    if not found:
        return False
    mean_g = np.vstack(found)
    direction = mean_g / np.maximum(np.linalg.norm(mean_g, axis=1, keepdims=True), 1e-300)
    return bool(np.any(np.linalg.norm(direction - direction[0], axis=1) >= LEAST_TURN_RAD))


@once_a_run
def acceleration_by_second(run: Run) -> Array | None:
    """Mean acceleration of each second of a run that has samples, shape [m, 3], g."""
    acc_g = acceleration_g(run)
    if acc_g is None or not len(acc_g):
        return None
    starts = np.unique(np.floor(run.t_s - run.t_s[0]), return_index=True)[1]
    return np.asarray(np.add.reduceat(acc_g, starts, axis=0) / np.diff([*starts, len(acc_g)])[:, None])


def means_of_tenths(values: Array) -> Array:
    """Means of ``values`` [n, k] over ten successive parts of a run, as even as possible; shape [min(n, 10), k]."""
    edges = np.linspace(0, len(values), min(10, len(values)) + 1).astype(np.intp)
    return np.asarray(np.add.reduceat(values, edges[:-1], axis=0) / np.diff(edges)[:, None])


def temperature_moves(runs: Sequence[Run]) -> bool:
    """True if the temperature changes by 1 degC or more over the runs that have a thermometer."""
    means = [temperature_by_second(r)[1] for r in runs if r.temp_c is not None]
    return bool(means) and bool(np.ptp(np.concatenate(means)) >= LEAST_RANGE_C)


@once_a_run
def temperature_by_second(run: Run) -> tuple[Array, Array]:
    """Mean time (s) and temperature (degC) of each second of a run that has samples, shape [m] each."""
    temp_c = temperature_c(run)
    assert temp_c is not None
    return _by_second(run, temp_c)


def _by_second(run: Run, temp_c: Array) -> tuple[Array, Array]:
    first = np.flatnonzero(np.diff(np.floor(elapsed_s(run)), prepend=-1.0))
    count = np.diff(first, append=len(run))
    return np.add.reduceat(run.t_s, first) / count, np.add.reduceat(temp_c, first) / count


def temperature_slope_c_s(run: Run) -> Array:
    """Rate of change of the temperature, shape [n], degC/s; zero without a thermometer or where the run is too short.

    A parabola is fitted to one-second means over 10 s. The window is longer if the noise and steps of the thermometer would
    exceed a tenth of the run's mean slope; the slope of a line over L points has the variance 12·sd^2/L^3. If a far shorter
    window would do, a cubic is fitted instead, which follows a temperature that turns within the window.
    """
    known = _temperature_slope_by_second(run)
    return np.zeros(len(run)) if known is None else from_seconds(run, known)


def from_seconds(run: Run, of_seconds: Array) -> Array:
    """Values of a run's seconds, [m] at the times of :func:`temperature_by_second`, at its samples, shape [n].

    They are linear between the seconds and constant before the first and after the last, as those of ``np.interp``, which looks
    up the place of every sample.
    """
    known_s, count = _places_of_seconds(run)
    slopes = np.zeros(count.size)
    slopes[1:-1] = np.diff(of_seconds) / np.diff(known_s)
    first, first_s = (np.concatenate([of[:1], of]) for of in (of_seconds, known_s))
    out = run.t_s - np.repeat(first_s, count)
    out *= np.repeat(slopes, count)
    out += np.repeat(first, count)
    return out


@once_a_run
def _places_of_seconds(run: Run) -> tuple[Array, np.ndarray[Any, np.dtype[np.intp]]]:
    """Mean time (s) of each second of a run, shape [m], and the numbers of samples before, between and after them, [m + 1]."""
    known_s = _by_second(run, run.t_s)[0]
    return known_s, np.diff(np.searchsorted(run.t_s, known_s), prepend=0, append=len(run))


@once_a_run
def _temperature_slope_by_second(run: Run) -> Array | None:
    """The rate of change of the temperature in each second of a run, shape [m], degC/s."""
    if run.temp_c is None:
        return None
    t_s, temp_c = _by_second(run, _filled(run.temp_c, run.t_s))
    if t_s.size < 5:
        return None
    steps = np.abs(np.diff(run.temp_c))
    resolution_c = float(np.min(steps, where=steps > 0, initial=np.inf))
    if not np.isfinite(resolution_c):
        return None
    variance = float(np.mean(np.diff(temp_c, 2) ** 2)) / 6 + resolution_c**2 / 12
    spacing_s = float(t_s[-1] - t_s[0]) / (t_s.size - 1)
    wanted = 0.1 * float(np.ptp(temp_c)) / t_s.size
    needed = (12 * variance / max(wanted, 1e-12) ** 2) ** (1 / 3)
    points = max(TEMPERATURE_WINDOW_S / spacing_s, needed)
    return slope(temp_c, t_s, points, order=3 if needed < CUBIC * points else 2)


def rate_slope_dps_s(run: Run, axis: int) -> Array:
    """Rate of change of the true rate about an axis, shape [n], deg/s^2; zero where the rate is constant."""
    if axis != run.axis_index or run.reference_dps is None or len(run) < 5:
        return np.zeros(len(run))
    return slope(true_rate_dps(run), run.t_s, RATE_WINDOW_S * run.sample_rate_hz)


def rate_varies(runs: Sequence[Run], axis: int) -> bool:
    """True if the true rate about this axis changes within at least one run."""
    return any(float(np.sqrt(np.mean(rate_slope_dps_s(r, axis) ** 2))) > LEAST_ACCELERATION_DPS_S for r in runs)


def sense_of_change(run: Run, axis: int) -> Array:
    """The sign of the change of the true rate about an axis, shape [n]; at a constant rate, that of the last change."""
    slope_dps_s = rate_slope_dps_s(run, axis)
    sign = np.where(np.abs(slope_dps_s) > LEAST_ACCELERATION_DPS_S, np.sign(slope_dps_s), 0.0)
    return sign[np.maximum.accumulate(np.where(sign != 0, np.arange(sign.size), 0))]


def slope(values: Array, t_s: Array, points: float, order: int = 2) -> Array:
    """Slope of a polynomial fitted to ``points`` neighbours (Savitzky and Golay), shape [n]. The times may jitter."""
    size = values.size
    window = min(2 * round(max(points, 5) / 2) + 1, size - 1 + size % 2)
    order = min(order, window - 1)
    return _per_sample(values, window, order) / _per_sample(t_s, window, order)


def _per_sample(x: Array, window: int, order: int) -> Array:
    """Slope per sample of the polynomial fitted to ``window`` neighbours; at the ends, of that of the first or last ones."""
    half = window // 2
    powers = np.arange(1, order + 1)
    place = np.linspace(-1, 1, window)
    fit = np.linalg.pinv(np.vander(place, order + 1, increasing=True))
    slopes = powers * place[:, None] ** (powers - 1) / max(half, 1)
    out = np.empty(x.size)
    out[half : x.size - half] = convolved(x, (slopes[half] @ fit[1:])[::-1])
    out[:half] = slopes[:half] @ (fit[1:] @ x[:window])
    out[x.size - half :] = slopes[window - half :] @ (fit[1:] @ x[-window:])
    return out


def _filled(values: Array, t_s: Array) -> Array:
    known = np.isfinite(values)
    return values if known.all() else np.interp(t_s, t_s[known], values[known])


def grid_dps(readings: Sequence[Array]) -> float:
    """The step of which all readings [n] are whole multiples: the smallest gap between occurring values, deg/s.

    A file that rounds its readings to a few decimals makes that gap too small or too large by its last digit. The step is then
    that of which all readings are multiples within the rounding, if there is one.
    """
    values: Array = np.unique(np.round(np.concatenate(readings), DECIMALS)).astype(np.float64)
    gaps = np.diff(values)
    gaps = gaps[gaps > 1e-6]
    if not gaps.size:
        return np.inf
    least_dps = float(gaps.min())
    if np.all(np.abs(values - least_dps * np.rint(values / least_dps)) < EXACT_DPS):
        return least_dps
    return _rounded_grid_dps(values, gaps) or least_dps


def _rounded_grid_dps(values: Array, gaps: Array) -> float | None:
    """The step by whose multiples values [n] differ, within the last decimal to which all are rounded; None if there is none.

    It is fitted near the middle value first, and with small multiples known to larger ones. Where an offset was subtracted
    before the rounding, zero need not be among them.
    """
    decimals = next((d for d in range(DECIMALS) if np.all(np.abs(values - np.round(values, d)) < EXACT_DPS)), DECIMALS)
    last_dps, from_middle = 10.0**-decimals, values - values[values.size // 2]
    step_dps = float(np.mean(gaps[gaps < FEWER_THAN_TWO * (gaps.min() + last_dps)]))
    if values.size < FEWEST_VALUES or step_dps < FEWER_THAN_TWO * last_dps:
        return None
    offset_dps, multiples, largest_dps = 0.0, FIRST_MULTIPLES, float(np.abs(from_middle).max())
    while True:
        some = from_middle[np.abs(from_middle) <= (multiples + 0.5) * step_dps]
        whole = np.rint((some - offset_dps) / step_dps)
        if np.ptp(whole) > 0:
            step_dps, offset_dps = (float(c) for c in np.polyfit(whole, some, 1))
        if multiples * step_dps >= largest_dps:
            break
        multiples *= 2
    whole = np.rint((from_middle - offset_dps) / step_dps)
    nearby = step_dps + np.linspace(-1, 1, NEARBY) * last_dps / max(1.0, float(np.abs(whole).max()))
    ranges_dps = [float(np.ptp(from_middle - step * whole)) for step in nearby]  # rounding is not even where it meets halves
    best = int(np.argmin(ranges_dps))
    return float(nearby[best]) if ranges_dps[best] < WITHIN_ROUNDING * last_dps + EXACT_DPS else None


def cosines(part: Array, count: int) -> Array:
    """``cos(pi·k·part)`` for k = 1 to ``count`` at the parts [n] of a range, shape [count, n], by Chebyshev's recurrence."""
    waves = np.empty((count, part.size))
    first = np.cos(np.pi * part, out=waves[0])
    twice = 2 * first
    for k in range(1, count):
        np.multiply(twice, waves[k - 1], out=waves[k])
        waves[k] -= waves[k - 2] if k > 1 else 1.0
    return waves


def unit_wave(angle_rad: Array) -> np.ndarray[Any, np.dtype[np.complex128]]:
    """``exp(i·angle)``, shape [n]; a real cosine and sine are faster than a complex exponential."""
    out = np.empty(angle_rad.shape, dtype=np.complex128)
    out.real, out.imag = np.cos(angle_rad), np.sin(angle_rad)
    return out
