"""The simulated campaign that benchmark `paper` judges: three days of 13, 7 and 28 scenarios, and the model that ships."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np

from gyrocal.core.estimator import CoreEstimator
from gyrocal.recording.session import Array
from gyrocal.simulation.simulate import RATE_HZ, TABLE_RATE_DPS, paper_windows

FIRST_SEED = 700_000
DAYS = np.repeat([1, 2, 3], [13, 7, 28])
SECONDS = (2.0, 4.0, 6.0)
MOST = round(SECONDS[-1] * RATE_HZ)
"""How many samples the longest answer uses."""
LABEL_S = 70
MODEL = Path(str(files("gyrocal"))) / "data" / "table2"


@dataclass(frozen=True)
class Campaign:
    """48 scenarios: each face's measured minus true rate in dps [48, samples of 70 s], and the true scale and bias [48, 2]."""

    up: Array
    down: Array
    truth: Array
    baseline: Array
    """Scale and bias in dps after 1, 2, ... 70 s, [70, 48, 2]."""

    @staticmethod
    def draw(seed: int) -> Campaign:
        data = paper_windows(len(DAYS), seed, float(LABEL_S))
        ends = np.round(np.arange(1, LABEL_S + 1) * RATE_HZ).astype(int)
        up, down = (np.cumsum(data[f], axis=1, dtype=float)[:, ends - 1] / ends for f in ("up", "down"))
        baseline = np.stack([(up - down) / (2 * TABLE_RATE_DPS), (up + down) / 2], axis=-1).swapaxes(0, 1)
        return Campaign(data["up"], data["down"], np.column_stack([data["scale"], data["bias_dps"]]), baseline)


@cache
def shipped() -> CoreEstimator:
    """The model that ships, in the C core."""
    return CoreEstimator(MODEL / "calibration.h")
