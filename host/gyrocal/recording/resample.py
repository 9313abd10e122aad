"""A run brought to a slower rate: a sample is the mean over its period, which keeps angles."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gyrocal.recording.measured_rates import QUATERNION
from gyrocal.recording.session import Array
from gyrocal.recording.stamps import typical_step_s

HELD = 1.5
"""Steps that a sample stands for at most: beyond lies a gap."""


def resampled(columns: Mapping[str, Array], rate_hz: float) -> dict[str, Array]:
    """Columns [n] of a run as ``rate_hz`` samples a second [m]; periods without a sample are left out.

    Rates, accelerations and temperatures are means over the period, angles and quaternions are taken at its middle.
    """
    t_s = columns["t_s"]
    step_s = typical_step_s(t_s)
    edges_s = np.arange(t_s[0] - step_s / 2, t_s[-1] + step_s / 2, 1 / rate_hz)
    middle_s = (edges_s[1:] + edges_s[:-1]) / 2
    held = np.searchsorted(t_s, edges_s)
    kept = np.diff(held) > 0
    out = {"t_s": middle_s[kept] - middle_s[kept][0]}
    for name, values in columns.items():
        if name == "t_s":
            continue
        known = np.isfinite(values)
        if known.sum() < 2:
            out[name] = np.full(int(kept.sum()), np.nan)
        elif name.endswith("_deg") or name in QUATERNION:
            out[name] = np.interp(middle_s[kept], t_s[known], values[known])
        else:
            out[name] = _means(t_s[known], values[known], edges_s, step_s)[kept]
    if QUATERNION[0] in out:
        norm = np.sqrt(sum(out[name] ** 2 for name in QUATERNION))
        out.update({name: out[name] / norm for name in QUATERNION})
    return out


def _means(t_s: Array, values: Array, edges_s: Array, step_s: float) -> Array:
    """The means between edges [m + 1], s, of values [n] that each hold from half way before to half way after their time."""
    between = (t_s[1:] + t_s[:-1]) / 2
    half_s = HELD * step_s / 2
    start = np.concatenate([[t_s[0] - step_s / 2], np.maximum(between, t_s[1:] - half_s)])
    end = np.concatenate([np.minimum(between, t_s[:-1] + half_s), [t_s[-1] + step_s / 2]])
    knots = np.ravel(np.column_stack([start, end]))
    spans = np.concatenate([[0.0], np.cumsum(end - start)])
    areas = np.concatenate([[0.0], np.cumsum((end - start) * values)])
    area = np.interp(edges_s, knots, np.ravel(np.column_stack([areas[:-1], areas[1:]])))
    span = np.interp(edges_s, knots, np.ravel(np.column_stack([spans[:-1], spans[1:]])))
    filled = np.diff(span)
    return np.divide(np.diff(area), filled, out=np.full(filled.size, np.nan), where=filled > 0)
