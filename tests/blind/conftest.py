"""A plain session, effects planted in it, and what its files hold."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl

from .generator.case import AXES, Case, Effect, Truth

PLAIN = Case("plain", "null", "paper", 11, 6.0, scenarios=3, turn_on_sd_dps=0.01)
LENGTH_S = {"paper": 6.0, "full": 4.0, "swing": 6.0}


def with_effect(id_: str, axes: str = "z", protocol: str = "paper", seed: int = 11, **parameters: float) -> Case:
    effect = Effect(id_, parameters, axes)
    return replace(PLAIN, protocol=protocol, seconds=LENGTH_S[protocol], seed=seed, effects=(effect,))


def read_run(folder: Path, file: str) -> pl.DataFrame:
    return pl.read_parquet(folder / file) if file.endswith("parquet") else pl.read_csv(folder / file)


def reading_of(folder: Path, file: str) -> np.ndarray:
    return read_run(folder, file).select([f"g{axis}_dps" for axis in AXES]).to_numpy().T


def noise_left(folder: Path, truth: Truth) -> np.ndarray:
    """The reading of every run less all that the truth accounts for, [3, runs, n]."""
    left = []
    for run in truth.runs:
        rest = reading_of(folder, run.file) - run.bias_dps[:, None] - run.drift_dps - run.earth_dps
        axis = AXES.index(truth.case.table_axis)
        rest[axis] -= (1 + run.scale[axis]) * run.rate_dps
        left.append(rest - sum(run.injected_dps.values(), np.zeros_like(rest)))
    return np.stack(left, axis=1)
