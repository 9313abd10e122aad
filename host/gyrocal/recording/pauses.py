"""Pauses between recordings that stand in one file: no samples were lost in them."""

from __future__ import annotations

import numpy as np

from gyrocal.policy import POLICY
from gyrocal.recording.stamps import Array, Index


def pauses_of(t_s: Array) -> Index:
    """The samples before the steps of times [n], s, that are longer than the shorter of the recordings beside them."""
    steps_s = np.diff(t_s)
    long = np.flatnonzero(steps_s > POLICY.pause_s)
    while long.size:
        edges = np.concatenate([[0], long + 1, [t_s.size]])
        lasts_s, sizes = t_s[edges[1:] - 1] - t_s[edges[:-1]], np.diff(edges)
        shorter_s, fewer = np.minimum(lasts_s[:-1], lasts_s[1:]), np.minimum(sizes[:-1], sizes[1:])
        wrong = (steps_s[long] <= shorter_s) | (fewer < POLICY.pause_samples)
        if not wrong.any():
            return long
        shortest = np.flatnonzero(wrong)[np.argmin(steps_s[long[wrong]])]
        long = np.delete(long, shortest)
    return long
