"""Whether a wave keeps its phase and size within the runs.

A vibration of one frequency does. A resonance of the mount, which noise excites, changes phase within a few periods over its
bandwidth, and an error in proportion to the motion changes with it. Both have lines in the spectra of short runs. A wave
that is fixed to the table keeps its phase exactly. Stick-slip and two-point control have a few periods of unequal lengths.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gyrocal.diagnosis.residual.angles import measured_angle_noise_deg
from gyrocal.inference.fitted import AxisFit, Fit
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array

LEAST_PERIODS = 1.5
"""Number of periods in a part."""
QUARTERS = 4


class WaveOfRun(NamedTuple):
    """What is left of a run's readings beside the other terms [m], and the wave's columns [m, k], times the ``weight`` [m]."""

    y: Array
    wave: Array
    weight: Array


def waves_of(fitted: AxisFit, own: list[int]) -> list[WaveOfRun]:
    """The last term of a fit in each run.

    ``own`` lists the wave's columns, a cosine and a sine for each amplitude, among the coefficients of the design.
    """
    out = []
    for i, block in enumerate(fitted.design.blocks):
        weight = np.sqrt(block.n)
        wave = (fitted.design.columns(i)[1:][own] * weight).T
        u = fitted.run_coefficients(i, fitted.solution.beta, fitted.spreads)
        y = fitted.block_residuals(i) * weight + wave @ np.concatenate([fitted.solution.beta, u])[own]
        out.append(WaveOfRun(y, wave, weight))
    return out


def keeps_its_phase(fitted: AxisFit, waves: Sequence[WaveOfRun], least: float) -> bool:
    """True unless the parts of the runs contradict that the last term of a fit is one wave in each run.

    If they certainly do, the wave of the whole run must hold at least ``least`` of the power.

    ``waves`` are those of :func:`waves_of`. The wave is fitted to each part of a run alone. What the parts gain beyond the
    whole run is noise if the wave keeps its phase. With v for the variance of white noise and k parts of m columns, it is v
    times a chi-square with m·(k - 1) degrees of freedom.
    """
    of_run = incoherent = degrees = 0.0
    for y, wave, weight in waves:
        parts = np.array_split(np.arange(len(y)), _parts(wave))
        if len(parts) < 2 or not np.any(wave):
            continue
        steady = np.concatenate([_without_trend(np.column_stack([y, wave])[p], weight[p]) for p in parts])
        y, wave = steady[:, 0], steady[:, 1:]
        whole = _fitted_power(wave, y)
        of_run += whole
        incoherent += sum(_fitted_power(wave[p], y[p]) for p in parts) - whole
        degrees += wave.shape[1] * (len(parts) - 1)
    noise = fitted.noise.white_sd_dps**2
    beyond = incoherent - degrees * noise
    certain = beyond > POLICY.coherence_errors * noise * np.sqrt(2 * degrees)
    return not certain or of_run > least * (of_run + beyond)


def keeps_its_size(fitted: AxisFit, waves: Sequence[WaveOfRun]) -> bool:
    """False if the power of a tone, over all runs, is certainly far smaller in a quarter of their time than it is on average.

    A tone that decays or grows in each run is another effect, such as a mount that rings after a start. ``waves`` are as
    above. Each quarter has a phase of its own, so that a frequency that wanders counts as one size.
    """
    power, variance, energy = (np.zeros(QUARTERS) for _ in range(3))
    noise = fitted.noise.white_sd_dps**2
    for y, wave, weight in waves:
        if _parts(wave) < QUARTERS:
            continue
        for q, p in enumerate(np.array_split(np.arange(len(y)), QUARTERS)):
            steady = _without_trend(np.column_stack([y, wave])[p], weight[p])
            power[q] += _fitted_power(steady[:, 1:], steady[:, 0]) - wave.shape[1] * noise
            variance[q] += 2 * wave.shape[1] * noise**2
            energy[q] += float(np.sum(steady[:, 1:] ** 2))
    if not energy.all():
        return True
    size, se = power / energy, np.sqrt(variance + 4 * noise * np.maximum(power, 0.0)) / energy
    return bool(np.all(size + POLICY.coherence_errors * se >= POLICY.even**2 * size.mean()))


def of_angles(fitted: Fit) -> bool:
    """True if the true rate is the slope of measured angles. Its noise grows with frequency, and no test of power applies."""
    return any(b.run.measured_rates is not None and b.run.measured_rates.derived for b in fitted.blocks)


def line_of_reference(fitted: Fit, axis: str, frequency_hz: float, amplitude_dps: float) -> bool:
    """True if a line in what is left of the readings is that of measured angles: of their steps, or not in the readings."""
    if amplitude_dps < 2 * np.pi * frequency_hz * measured_angle_noise_deg(fitted.session, axis):
        return True  # the steps of an encoder make lines, whose angle is below its noise
    return of_angles(fitted) and _in_readings_dps(fitted, axis, frequency_hz) < POLICY.read_part * amplitude_dps


def _in_readings_dps(fitted: Fit, axis: str, frequency_hz: float) -> float:
    """Amplitude of the readings at a frequency, the largest of all runs, deg/s."""
    found = []
    for run in (b.run for b in fitted.blocks):
        window = np.hanning(len(run))
        read_dps = run.gyro_dps[:, AXES.index(axis)]
        wave = np.exp(-2j * np.pi * frequency_hz * run.sample_s)
        found.append(2 * abs(np.sum(window * (read_dps - read_dps.mean()) * wave)) / float(window.sum()))
    return float(max(found))


def of_the_reference(fitted: AxisFit, waves: Sequence[Array]) -> bool:
    """True if the reference holds the wave that a fit finds in what is left of the readings.

    ``waves`` are the fitted wave in the blocks of each run, deg/s. What is left is the reading less the reference, so that a
    wave of the reference alone, such as the beat of an encoder's steps with the sampling, is there with the opposite sign. One
    that both have is a motion, of which an error in proportion to the motion leaves a part. A motion of another form and of a
    similar frequency resembles the wave by chance, and the more so the larger it is.
    """
    held = power = by_chance = 0.0
    for block, wave in zip(fitted.design.blocks, waves, strict=True):
        run = block.run
        if not wave.size or run.rate_is_mean or not np.any(wave):
            continue
        known = fitted.design.axis == run.axis_index
        reference = block.mean(run.rate_dps[:, None])[:, 0] if known else np.zeros(wave.size)
        both = _about_its_frequency(np.column_stack([reference, wave]))
        for part in np.array_split(np.arange(len(both)), _parts(wave[:, None])):
            of_reference, of_wave = _without_trend(both[part], np.ones(part.size)).T
            held += float(of_reference @ of_wave)
            power += float(of_wave @ of_wave)
            by_chance += float(of_wave @ of_wave) * float(np.mean(of_reference**2))
    return abs(held) > max(POLICY.wave_of_reference * power, POLICY.coherence_errors * np.sqrt(by_chance))


def _about_its_frequency(columns: Array) -> Array:
    """Second differences of columns [n, 2] over half a period of the wave, which is the last of them.

    They keep the wave and weaken what is slower. A motion of 100 deg/s would hide a wave of the reference of 0.2 deg/s.
    """
    signs = np.signbit(columns[:, -1])
    half = round(len(columns) / max(1, int(np.count_nonzero(signs[1:] != signs[:-1]))))
    if len(columns) <= 4 * half:
        return columns
    return np.asarray((columns[2 * half :] - 2 * columns[half:-half] + columns[: -2 * half]) / 4)


def _without_trend(columns: Array, weight: Array) -> Array:
    """Columns [n, k], weighted by ``weight`` [n], without an offset and a slope of slower causes."""
    n = len(weight)
    slow = np.linalg.qr(np.column_stack([np.ones(n), np.arange(n) - (n - 1) / 2]) * weight[:, None])[0]
    return columns - slow @ (slow.T @ columns)


def _parts(wave: Array) -> int:
    """The number of parts of a run, from the periods of its wave [n, columns]: a column changes sign twice in a period."""
    signs = np.signbit(wave[:, 0])
    periods = np.count_nonzero(signs[1:] != signs[:-1]) / 2
    return int(np.clip(periods // LEAST_PERIODS, 1, POLICY.most_parts))


def _fitted_power(wave: Array, y: Array) -> float:
    """Sum of squares of what the columns [n, k] take from y [n]."""
    return float(np.sum((wave @ np.linalg.lstsq(wave, y, rcond=None)[0]) ** 2))
