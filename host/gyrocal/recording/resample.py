"""A reference that was recorded in another file, at its own times, brought to the times of the sensor's samples."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gyrocal.recording.measured_rates import GAP_STEPS, QUATERNION

Array = np.ndarray[Any, np.dtype[np.float64]]


def resampled(reference: Mapping[str, Array], t_s: Array, at_s: Array) -> dict[str, Array]:
    """The reference's columns [n], recorded at the times ``t_s`` [n], at the times ``at_s`` [m], s.

    A cubic spline through the samples is taken between them. A quaternion is continued without flips of its sign and brought
    back to the length 1. Where no sample is near (before the first, after the last, in a gap), the result is NaN. The clocks
    need not agree: ``clock = "own"`` in session.toml has the offset estimated.
    """
    from scipy.interpolate import CubicSpline

    columns = dict(reference)
    known = np.logical_and.reduce([np.isfinite(c) for c in columns.values()])
    known_s = t_s[known]
    if set(QUATERNION) <= set(columns):
        q = np.column_stack([columns[name] for name in QUATERNION])[known]
        sign = np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0, -1.0, 1.0))
        q[1:] *= sign[:, None]
        at = CubicSpline(known_s, q)(at_s)
        at /= np.linalg.norm(at, axis=1, keepdims=True)
        found = dict(zip(QUATERNION, at.T, strict=True))
    else:
        found = {}
    found |= {name: CubicSpline(known_s, c[known])(at_s) for name, c in columns.items() if name not in found}
    after = np.clip(np.searchsorted(known_s, at_s), 1, known_s.size - 1)
    step_s = float(np.median(np.diff(known_s)))
    inside = (at_s >= known_s[0]) & (at_s <= known_s[-1]) & (known_s[after] - known_s[after - 1] <= GAP_STEPS * step_s)
    return {name: np.where(inside, values, np.nan) for name, values in found.items()}
