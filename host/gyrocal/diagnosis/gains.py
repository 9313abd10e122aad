"""What a candidate gains on data that its fit never saw."""

from __future__ import annotations

import numpy as np

from gyrocal.inference import heldout
from gyrocal.inference.fitted import AxisFit
from gyrocal.recording.session import Array


def held_out_gain(current: AxisFit, fitted: AxisFit, folds: list[heldout.Fold]) -> Array:
    """Gain in predictive log-likelihood of each held-out scenario (run, time block), shape [units]."""
    gains: list[float] = []
    for before, after in zip(heldout.steps(current, folds), heldout.steps(fitted, folds), strict=True):
        gains += [after.gain[name] - before.gain[name] for name in before.gain]
    return np.array(gains)


def total(gains: Array) -> tuple[float | None, float | None]:
    """Sum of gains [units] and its standard error; None where there are too few of them."""
    error = float(np.sqrt(gains.size) * np.std(gains, ddof=1)) if gains.size > 1 else None
    return (float(np.sum(gains)) if gains.size else None), error
