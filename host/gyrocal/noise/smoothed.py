"""Readings that a filter has smoothed before they were written, as a running mean over the last samples does."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gyrocal.noise.color import MOST_ALIKE
from gyrocal.recording.once import once
from gyrocal.recording.session import Array, Run

LONGEST = 64
"""Samples over which a filter is looked for. What is alike for longer is a wave or a drift."""
LEAST = 16 * LONGEST
"""Number of samples that show a filter."""
SHOWN = 0.05
"""Correlation of steps up to which a filter's end counts as nothing."""
ERRORS = 5.0
"""Standard errors that such a correlation must exceed, so that white noise shows none at any of the delays."""


@once
def smoothed_s(runs: Sequence[Run], axis: int, apart_s: float) -> float:
    """The time over which a filter has made the readings of an axis alike, s; 0 where no more than a colour describes.

    Means over ``apart_s`` are what a colour is of. At rest and at constant rates alone: of a motion, the readings are alike
    without a filter.
    """
    apart = max(1, round(apart_s * runs[0].sample_rate_hz))
    if apart > LONGEST or any(run.rate_is_mean or run.measured_rates is not None for run in runs):
        return 0.0
    readings = [run.gyro_dps[:, axis] for run in runs]
    samples = smoothed_over(readings)
    if samples <= apart or _moved(readings, apart) >= (1 - MOST_ALIKE) * _moved(readings, samples):
        return 0.0
    return samples / runs[0].sample_rate_hz


def _moved(readings: Sequence[Array], by: int) -> float:
    """The mean square by which readings [n] of runs differ from those ``by`` samples later, (deg/s)^2."""
    return float(np.mean(np.concatenate([values[by:] - values[:-by] for values in readings]) ** 2))


def smoothed_over(readings: Sequence[Array]) -> int:
    """The number of samples over which a filter has made the noise in the readings [n] of runs alike; 1 without a filter.

    A filter of m samples leaves the steps from sample to sample correlated up to a delay of m samples and no further, and
    the steps of a bias that wanders are independent of each other.
    """
    size = 2 * LONGEST
    power, number = np.zeros(size + 1), 0
    for values in readings:
        steps = np.diff(values)
        if steps.size <= size:
            continue
        steps = steps - steps.mean()
        spectrum = np.fft.rfft(steps, 1 << (2 * steps.size - 1).bit_length())
        power += np.fft.irfft(np.abs(spectrum) ** 2)[: size + 1]
        number += steps.size
    if number < LEAST or not power[0] > 0:
        return 1
    correlation = power / power[0]
    error = float(np.sqrt((2 * correlation @ correlation - 1) / number))  # where there is none (Bartlett's formula)
    alike = np.flatnonzero(np.abs(correlation) > max(SHOWN, ERRORS * error))
    last = int(alike[-1]) if alike.size else 0  # beside a large tone, so few samples show nothing
    return last if 0 < last <= LONGEST else 1
