"""Runs with any columns, without noise."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

from gyrocal.recording.session import Run
from make_runs import make_run

Array = NDArray[np.float64]
MakeRun = Callable[..., Run]


make = partial(make_run, lsb_dps=0.00875)


@pytest.fixture(name="make_run")
def _make_run() -> MakeRun:
    return make


@pytest.fixture
def rich_run() -> Run:
    """A run that has every optional column, all of them moving."""
    rng = np.random.default_rng(5)
    t_s = np.arange(8000) / 100.0
    return make(
        t_s,
        power_on_s=4.0,
        rate_ref_dps=90 * np.sin(2 * np.pi * 0.15 * t_s) + 20,
        temp_c=20 + 15 * np.sin(2 * np.pi * t_s / 120),
        ax_g=rng.normal(0, 1, t_s.size),
        ay_g=rng.normal(0, 1, t_s.size),
        az_g=rng.normal(0, 1, t_s.size),
    )
