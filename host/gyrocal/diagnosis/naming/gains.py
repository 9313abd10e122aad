"""The gain of a candidate on held-out data."""

from __future__ import annotations

import numpy as np

from gyrocal.inference import heldout
from gyrocal.inference.fitted import AxisFit
from gyrocal.inference.same_blocks import on_same_blocks
from gyrocal.recording.session import Array


def held_out_gain(current: AxisFit, fitted: AxisFit, folds: list[heldout.Fold]) -> Array:
    """Gain in predictive log-likelihood of each held-out unit (power cycle, run or block of time), shape [units].

    Only blocks that both fits see count.
    """
    current, fitted = on_same_blocks(current, fitted)
    gains: list[float] = []
    for before, after in zip(heldout.steps(current, folds), heldout.steps(fitted, folds), strict=True):
        gains += [after.gain[name] - before.gain[name] for name in before.gain]
    return np.array(gains)


def total(gains: Array) -> tuple[float | None, float | None]:
    """Sum of the gains [units] and its standard error; None where there are too few units, or one that is not predicted."""
    error = float(np.sqrt(gains.size) * np.std(gains, ddof=1)) if gains.size > 1 and np.isfinite(gains).all() else None
    least = float(np.min(gains, initial=0.0))  # beside a unit that is ruled out, no gain counts
    return (None if not gains.size else least if np.isneginf(least) else float(np.sum(gains))), error
