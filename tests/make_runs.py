"""Runs and sessions for tests, from arrays."""

from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import ArrayLike, NDArray

from gyrocal.recording.session import Run, Session

Array = NDArray[np.float64]


def make_run(
    t_s: Array,
    gyro_dps: ArrayLike = 0.0,
    *,
    table_rate_dps: float | None = 78.0,
    turn_deg: float | None = None,
    face: Any = "up",
    axis: Any = "z",
    scenario: str = "s000",
    day: int | None = None,
    power_on_s: float | None = None,
    rate_hz: float | None = None,
    lsb_dps: float | None = None,
    **columns: ArrayLike,
) -> Run:
    """A run of samples at ``t_s`` [n], s.

    ``gyro_dps`` is [n, 3] or what can be broadcast to it; ``columns`` are optional columns by name, [n] or one value for all,
    where NaN stands for an empty cell. The table's rate is left out where a turn or a reference is given, and ``rate_hz`` is
    taken from the times where it is not given.
    """
    gyro = np.broadcast_to(np.asarray(gyro_dps, float), (t_s.size, 3))
    frame = pl.DataFrame(
        {"t_s": t_s, **{f"g{a}_dps": gyro[:, i] for i, a in enumerate("xyz")}}
        | {name: np.broadcast_to(np.asarray(value, float), t_s.shape) for name, value in columns.items()}
    ).fill_nan(None)
    rate_hz = rate_hz or round(float(1 / np.median(np.diff(t_s))), 6)
    known = turn_deg is not None or "rate_ref_dps" in columns
    return Run(
        0, f"000_{face}.csv", scenario, face, axis, None if known else table_rate_dps, turn_deg, day, power_on_s, rate_hz,
        frame=frame, lsb_dps=lsb_dps,
    )  # fmt: skip


def make_session(*runs: Run, **fields: Any) -> Session:
    """A session of these runs, numbered in their order; ``fields`` are the session's own, as ``axis`` or ``lsb_dps``."""
    numbered = (replace(run, index=i, file=f"{i:03d}_{run.face}.csv") for i, run in enumerate(runs))
    return Session(runs[0].sample_rate_hz, tuple(numbered), **fields)
