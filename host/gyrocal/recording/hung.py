"""Stretches in which a sensor hung: every axis repeats one reading although noise shows elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
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


def repeated(t_s: Array, readings: Sequence[Array]) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """The samples [n] of the ``readings`` [n] of each axis that a hung sensor repeated; the first of a stretch is a reading."""
    same = np.ones(t_s.size, dtype=bool)
    same[:1] = False
    for axis in readings:
        same[1:] &= axis[1:] == axis[:-1]
    hung = np.zeros(t_s.size, dtype=bool)
    if not any(np.ptp(axis) > 0 for axis in readings):
        return hung
    for first, length in zip(*stretches(same), strict=True):
        if length >= LEAST_SAMPLES and t_s[first + length - 1] - t_s[first - 1] >= LEAST_S:
            hung[first : first + length] = True
    others = same[~hung]
    return hung if others.size and float(np.mean(others)) < SELDOM else np.zeros(t_s.size, dtype=bool)


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
