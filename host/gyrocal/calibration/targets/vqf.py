"""Arguments of the orientation filter VQF: what the model knows of the bias, and the matrix that its readings need before.

Source: VQF's documentation of its parameters. ``biasSigmaInit`` (deg/s) is the standard deviation of the bias at the start,
``biasForgettingTime`` (s) the time in which that of a known bias grows to 0.1 deg/s, ``biasClip`` (deg/s) the largest bias.
"""

from __future__ import annotations

import json
import math

import numpy as np

from gyrocal.calibration.targets.base import RAD, Rendered, bias_dps, left_of, needs_rate, random_walks, response
from gyrocal.error_model.model import Model
from gyrocal.recording.session import AXES

DEFAULT_SIGMA_DPS, DEFAULT_CLIP_DPS, GROWN_TO_DPS = 0.5, 2.0, 0.1
SPREADS = 4.0
"""The largest bias, in standard deviations of the power cycles."""


def render(model: Model, rate_hz: float | None) -> Rendered:
    """The text of ``vqf.json``: ``VQF(gyrTs, **params)``, fed with corrected readings."""
    spreads = [model.noise_on(axis).turn_on_bias for axis in AXES]
    turn_on_dps = max((s.sd_dps for s in spreads if s is not None and s.sd_dps is not None), default=None)
    walk_dps = max(random_walks(model), default=0.0) / RAD
    params: dict[str, float] = {}
    left = left_of(model, {"scale", "bias", "misalignment", "turn_on_bias", "colored_noise"}, "VQF corrects a bias only")
    if turn_on_dps is None:
        left["biasSigmaInit"] = f"the model knows no spread over power cycles; VQF's own is {DEFAULT_SIGMA_DPS} deg/s"
    else:
        params |= {"biasSigmaInit": turn_on_dps, "biasClip": max(DEFAULT_CLIP_DPS, SPREADS * turn_on_dps)}
    if walk_dps > 0:
        params["biasForgettingTime"] = (GROWN_TO_DPS / walk_dps) ** 2
    else:
        left["biasForgettingTime"] = "the model has no drift; VQF's own is 100 s"
    acc = model.accelerometer
    content = {
        "gyrTs": 1 / needs_rate(rate_hz, "vqf"), "params": params,
        "before": {
            "gyr": "gyr_matrix · (reading - gyr_bias), rad/s", "gyr_matrix": np.linalg.inv(response(model)).tolist(),
            "gyr_bias": [b * RAD for b in bias_dps(model)],
            **({} if acc is None else {
                "acc": "acc_matrix · (reading - acc_bias), any unit", "acc_matrix": acc.correction.tolist(),
                "acc_bias_g": list(acc.bias_g),
            }),
        },
    }  # fmt: skip
    assert all(math.isfinite(value) for value in params.values())
    return Rendered("vqf.json", json.dumps(content, indent=1, allow_nan=False) + "\n", left)
