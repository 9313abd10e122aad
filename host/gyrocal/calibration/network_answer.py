"""The shipped network's answer for a pair of runs: how much of them it takes, which runs suit it, and its prior."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gyrocal.calibration.estimator import Answer, calibration_of
from gyrocal.error_model.model import Model
from gyrocal.policy import POLICY
from gyrocal.recording.session import GAP_PERIODS, Run

if TYPE_CHECKING:
    from gyrocal.calibration.network import Prior

TRAINED_HZ, TRAINED_DPS = 145.0, 78.0
"""Sample rate and table rate of the shipped network's training, which its graph states; known here without onnxruntime."""


def network_stage(up: Run, down: Run, seconds: float) -> int | None:
    """0, 1 or 2: as much of the first 2, 4 or 6 s as ``seconds`` holds. None: too short for 2 s, or a sample is missing."""
    from gyrocal.calibration.network import STAGES_S

    stage = sum(s <= seconds + 1e-6 for s in STAGES_S) - 1
    enough = stage >= 0 and all(consecutive(r) >= round(STAGES_S[stage] * r.sample_rate_hz) for r in (up, down))
    return stage if enough else None


def network(up: Run, down: Run, stage: int, prior: Prior | None = None) -> Answer | None:
    """The shipped network `gyrocal` on the first 2, 4 or 6 s (``stage`` 0, 1 or 2), by default with flat priors.

    None if the sample rate or the true rate is not that of its training, or if the readings less their mean exceed the range
    of its training data.
    """
    from gyrocal.calibration.network import FLAT, FaceNetwork, merge

    net = FaceNetwork.shipped()
    n, runs = net.samples(stage), (up, down)
    w_dps = [float(np.mean(r.rate_dps[:n])) for r in runs]
    if not all(net.suits(r.sample_rate_hz, w) for r, w in zip(runs, w_dps, strict=True)):
        return None
    faces = [net.face(r.gyro_dps[:n, r.axis_index] - r.rate_dps[:n], stage, w) for r, w in zip(runs, w_dps, strict=True)]
    scale, bias_dps, scale_sd, bias_sd_dps = map(float, merge(faces[0], faces[1], prior or FLAT)[0])
    return Answer(scale, scale_sd, bias_dps, bias_sd_dps, None) if np.isfinite(scale) else None


def network_prior(model: Model | str | Path | None, axis: str) -> Prior:
    """The prior of scale and bias that a model gives; flat without a model."""
    from gyrocal.calibration.network import FLAT, Prior

    opened = None if model is None else Model.open(model)
    if opened is None or not opened.on(axis):
        return FLAT
    known = calibration_of(opened, axis, white_sd_dps=1.0)  # the noise does not matter here
    return Prior(known.scale, known.bias_dps)


def consecutive(run: Run) -> int:
    """Number of samples before the first missing one."""
    late = np.flatnonzero(1e-6 * (np.diff(run.t_us) * run.sample_rate_hz) > GAP_PERIODS)
    return int(late[0]) + 1 if late.size else len(run)


def suits_network(run: Run) -> bool:
    """True if the run has the sample rate and the table rate for which the shipped network was trained."""
    return near_training(run.sample_rate_hz, float(run.rate_dps[0]), TRAINED_HZ, TRAINED_DPS)


def near_training(rate_hz: float, w_dps: float, trained_hz: float, trained_dps: float) -> bool:
    """True for the sample rate of a network's training, and its table rate or the opposite one."""
    near = abs(abs(w_dps) - trained_dps) <= POLICY.network_table_rate * trained_dps
    return near and abs(rate_hz - trained_hz) <= POLICY.network_sample_rate * trained_hz
