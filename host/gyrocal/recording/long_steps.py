"""Whether samples are missing in the long steps of a run, as import counts them."""

from __future__ import annotations

import numpy as np

from gyrocal.recording.run import GAP_PERIODS, Run
from gyrocal.recording.stamps import PAUSE, course, lost, regression


def misses_samples(run: Run, first: int = 0, end: int | None = None) -> bool:
    """True if samples are missing between those from ``first`` up to ``end`` of a run.

    A program that takes samples when it comes to it makes up for a long step by a short one, and misses some in a pause alone,
    or where its long steps are whole numbers of the usual one. A late reading of an even course is none that is missing.
    """
    periods = 1e-6 * (np.diff(run.t_us[first:end]) * run.sample_rate_hz)
    if not np.any(periods > GAP_PERIODS):
        return False
    if np.any(periods > PAUSE):
        return True
    if course(run.t_s)[1]:
        return lost(run.t_s[first:end], 1 / run.sample_rate_hz) > 0
    return bool(np.any(np.diff(regression(run.t_s).number[first:end]) > 1))
