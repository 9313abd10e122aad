"""Readings at the end of the sensor's range, where the rate is at least what is read."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gyrocal.recording.run import Run

LARGEST_CODE = 32767
"""Largest code of a word of 16 bits, with a sign. Many chips read beyond their nominal range, up to this code."""
LAST_CODES = 8
"""Some chips end a few codes before it: a recording of an IMU that was thrown has 16 readings of exactly +-32764."""


def whole_steps(full_scale_dps: float, step_dps: float) -> float:
    """Full scale in whole steps, deg/s."""
    return float(np.floor(full_scale_dps / step_dps + 1e-9) * step_dps) if step_dps > 0 else full_scale_dps


def at_full_scale(run: Run, axis: int, full_scale_dps: float) -> NDArray[np.bool_]:
    """Mask [n] of the readings of an axis at the stated full scale or beyond, which count as clipped."""
    step_dps = run.count_dps(axis)
    return np.asarray(np.abs(run.gyro_dps[:, axis]) >= whole_steps(full_scale_dps, step_dps) - 0.5 * step_dps)


def at_largest_code(reading_dps: float, lsb_dps: float | None) -> bool:
    """True if a reading is among the first or last codes of a word of 16 bits. Readings beyond are of no such word."""
    return lsb_dps is not None and 0 <= LARGEST_CODE + 1 - round(abs(reading_dps) / lsb_dps) <= LAST_CODES
