"""Runs with any columns, without noise."""

from collections.abc import Callable
from typing import Any

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray

from gyrocal.recording.session import Run

Array = NDArray[np.float64]
MakeRun = Callable[..., Run]


def make(
    t_s: Array,
    *,
    table_rate_dps: float | None = 78.0,
    face: Any = "up",
    axis: Any = "z",
    power_on_s: float | None = None,
    scenario: str = "s000",
    index: int = 0,
    gyro_dps: Array | None = None,
    **columns: Any,
) -> Run:
    """A run of samples at ``t_s``; ``columns`` are optional columns by name (scalars are held)."""
    gyro = np.zeros((t_s.size, 3)) if gyro_dps is None else gyro_dps
    frame = pl.DataFrame(  # a NaN stands for an empty cell
        {"t_s": t_s, **{f"g{a}_dps": gyro[:, i] for i, a in enumerate("xyz")}}
        | {name: np.broadcast_to(np.asarray(value, float), t_s.shape) for name, value in columns.items()}
    ).fill_nan(None)
    rate_hz = float(1 / np.median(np.diff(t_s)))
    rate_dps = None if "rate_ref_dps" in columns else table_rate_dps
    return Run(
        index, f"{index}.csv", scenario, face, axis, rate_dps, None, None, power_on_s, round(rate_hz, 6), frame=frame,
        lsb_dps=0.00875,
    )  # fmt: skip


@pytest.fixture
def make_run() -> MakeRun:
    return make


@pytest.fixture
def rich_run() -> Run:
    """A run that has every optional column, all of them moving."""
    rng = np.random.default_rng(5)
    t_s = np.arange(2000) / 100.0
    return make(
        t_s,
        power_on_s=4.0,
        rate_ref_dps=90 * np.sin(2 * np.pi * 0.15 * t_s) + 20,
        temp_c=20 + 15 * np.sin(2 * np.pi * t_s / 120),
        ax_g=rng.normal(0, 1, t_s.size),
        ay_g=rng.normal(0, 1, t_s.size),
        az_g=rng.normal(0, 1, t_s.size),
    )
