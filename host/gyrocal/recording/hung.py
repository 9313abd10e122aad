"""Readings that repeat the one before on every axis: of a sensor that hung, or that is read faster than it samples."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gyrocal.digits import percentage
from gyrocal.recording.run import Array, Run
from gyrocal.recording.stamps import PART
from gyrocal.recording.stretches import stretches
from gyrocal.recording.table import REQUIRED
from gyrocal.warning import Warning

LEAST_S, LEAST_SAMPLES = 0.5, 40
"""Shortest such stretch, as of the warning ``constant_reading``."""
SELDOM = 0.02
"""Part of the other readings that repeat the one before on every axis, above which repeating is usual."""
SHORT_SAMPLES = 5
"""Longest other stretch of readings that often repeat, as coarse ones do, beside which those of a hung sensor stand out."""
OFTEN = 0.05
"""Part of the readings that repeat the one before, beyond chance, from which on the sensor is read faster than it samples."""
CHANCE_LAGS = range(64, 72)
"""Samples that lie as far apart are equal by chance alone."""
CLEAR_COUNTS = 3.0
"""Repeated readings count between changes of at least so many counts: slow and coarse readings repeat by themselves."""


def repeated(t_s: Array, readings: Sequence[Array]) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """The samples [n] of the ``readings`` [n] of each axis that a hung sensor repeated; the first of a stretch is a reading."""
    same = np.concatenate([[False], _equal(readings, 1)])
    hung = np.zeros(t_s.size, dtype=bool)
    if not any(np.ptp(axis) > 0 for axis in readings):
        return hung
    for first, length in zip(*stretches(same), strict=True):
        if length >= LEAST_SAMPLES and t_s[first + length - 1] - t_s[first - 1] >= LEAST_S:
            hung[first : first + length] = True
    if not hung.any():
        return hung
    others = same & ~hung
    seldom = not hung.all() and float(np.mean(others[~hung])) < SELDOM
    return hung if seldom or max(stretches(others)[1], default=0) <= SHORT_SAMPLES else np.zeros(t_s.size, dtype=bool)


def without_hung(columns: dict[str, Array], file: str) -> tuple[dict[str, Array], Warning | None]:
    """The columns of a run without the samples that a hung sensor repeated, with a warning that says which they are."""
    readings = [columns[name] for name in REQUIRED[1:] if name in columns]
    hung = repeated(columns["t_s"], readings)
    if not hung.any():
        return columns, None
    first, length = stretches(hung)
    t_s = columns["t_s"]
    told = ", ".join(f"{t_s[a]:.4g} to {t_s[a + n - 1]:.4g} s" for a, n in zip(first[:3], length[:3], strict=True))
    text = (
        f"the sensor hung: every axis repeats one reading from {told}{' and so on' if len(first) > 3 else ''}. "
        f"These {int(hung.sum())} samples are left out"
    )
    return {name: values[~hung] for name, values in columns.items()}, Warning("constant_reading", None, file, text)


def read_too_fast(run: Run) -> Warning | None:
    """``sample_rate`` of a run whose logger asks for readings more often than the sensor takes them, from its first samples."""
    first_rows = run.table.head(PART)
    readings = [axis for axis in (first_rows[name].to_numpy() for name in REQUIRED[1:]) if np.ptp(axis) > 0]
    size = first_rows.height
    if not readings or size < 2 * CHANCE_LAGS.stop:
        return None
    same = np.concatenate([[False], _equal(readings, 1)])
    changes = np.zeros(size)
    for axis in readings:
        steps = np.abs(np.diff(axis))
        changes[1:] = np.maximum(changes[1:], steps / steps[steps > 0].min())
    clear = np.concatenate([changes >= CLEAR_COUNTS, [True]])
    first, length = stretches(same)
    between = clear[first - 1] & clear[first + length]
    chance = float(np.mean([np.mean(_equal(readings, lag)) for lag in CHANCE_LAGS]))
    if float(length[between].sum()) / size - chance < OFTEN or between.sum() < OFTEN * size / LEAST_SAMPLES:
        return None
    part = 1 - (1 - float(np.mean(same))) / (1 - chance)
    text = (
        f"{percentage(part)} of the samples repeat the reading before on every axis: the sensor takes about "
        f"{run.sample_rate_hz * (1 - part):.3g} readings a second, and the logger stores {run.sample_rate_hz:.4g}. Repeated "
        "readings tell nothing, and noise and delay look larger by them: store each reading once, as at its data-ready signal"
    )
    return Warning("sample_rate", None, run.file, text)


def _equal(readings: Sequence[Array], lag: int) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Whether the ``readings`` [n] of every axis equal those of ``lag`` samples before, shape [n - lag]."""
    same = np.ones(max(0, readings[0].size - lag), dtype=bool)
    for axis in readings:
        same &= axis[lag:] == axis[:-lag]
    return same
