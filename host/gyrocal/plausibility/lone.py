"""Single readings that make the most of what a run leaves: a knock, or a packet that came damaged."""

from __future__ import annotations

import numpy as np

from gyrocal.plausibility.noise import still_dps
from gyrocal.recording.outliers import outliers
from gyrocal.recording.session import AXES, Array, Session
from gyrocal.warning import Warning


def check(session: Session) -> list[Warning]:
    """``line_damaged``: one reading at rest that has more of the power of a run than all others together."""
    out = []
    for run in session.runs:
        if run.rate_is_mean or np.any(run.rate_dps):
            continue
        for i, axis in enumerate(AXES):
            y_dps = still_dps(run, i)
            row, apart_dps = _largest(y_dps, float(run.step_dps[i]))
            others_dps2 = float(np.sum((y_dps - np.median(y_dps)) ** 2)) - apart_dps**2
            if apart_dps**2 <= others_dps2 or not apart_dps:
                continue
            text = (
                f"one reading of {axis} is {y_dps[row]:.4g} dps (at {run.t_s[row]:.6g} s), {abs(apart_dps):.3g} dps off those "
                "beside, and makes the most of the run's rms and floor: a knock, or a damaged packet. Cut that moment "
                "out (--run when importing), or record the rest again"
            )
            out.append(Warning("line_damaged", axis, run.file, text))
    return out


def _largest(y_dps: Array, step_dps: float) -> tuple[int, float]:
    """The row of the reading [n] that stands out farthest, and by how much, deg/s; 0 where none stands out."""
    rows, apart_dps = outliers(y_dps, step_dps)
    if not rows.size:
        return 0, 0.0
    k = int(np.argmax(np.abs(apart_dps)))
    return int(rows[k]), float(apart_dps[k])
