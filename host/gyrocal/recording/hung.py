"""Stretches in which a sensor hung: every axis repeats one reading although noise shows elsewhere."""

from __future__ import annotations

from typing import Any

import numpy as np

from gyrocal.recording.run import Array
from gyrocal.recording.stretches import stretches
from gyrocal.recording.table import REQUIRED
from gyrocal.warning import Warning

LEAST_S, LEAST_SAMPLES = 0.5, 40
"""Shortest such stretch, as of the warning ``constant_reading``."""
SELDOM = 0.02
"""Part of the other readings that repeat the one before on every axis, above which repeating is usual."""


def repeated(t_s: Array, readings: Array) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """The samples [n] of readings [n, k] that a hung sensor repeated; the first of each stretch is a reading."""
    same = np.concatenate([[False], np.all(np.diff(readings, axis=0) == 0, axis=1)])
    hung = np.zeros(t_s.size, dtype=bool)
    varied = np.ptp(readings, axis=0) > 0
    if not varied.any():
        return hung
    for first, length in zip(*stretches(same), strict=True):
        if length >= LEAST_SAMPLES and t_s[first + length - 1] - t_s[first - 1] >= LEAST_S:
            hung[first : first + length] = True
    others = same[~hung]
    return hung if others.size and float(np.mean(others)) < SELDOM else np.zeros(t_s.size, dtype=bool)


def without_hung(columns: dict[str, Array], file: str) -> tuple[dict[str, Array], Warning | None]:
    """The columns of a run without the samples that a hung sensor repeated, with a warning that says which they are."""
    readings = [columns[name] for name in REQUIRED[1:] if name in columns]
    hung = repeated(columns["t_s"], np.column_stack(readings))
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
