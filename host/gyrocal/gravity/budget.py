"""The error budget of a calibration: the contribution of every cause to each standard error.

Generalised least squares is linear in its rows, so each part of their covariance is multiplied by the same gain. The squares
of the contributions add up to the square of the standard error.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from gyrocal.effects.base import Role, with_role
from gyrocal.effects.clock_error import CLOCK_SE
from gyrocal.gravity.fit import GravityFit
from gyrocal.recording.session import AXES, Array

ADVICE = {
    "accelerometer": "rest longer, and in more poses",
    "gyroscope noise": "move quickly, and repeat the movements",
    "bias": "rest more often, so that the bias before and after each movement is known",
    "sample clock": "compare t_s with a better clock over an hour",
    "misfit": "diagnose the session: the movements differ by more than the noise",
}
NO_MISFIT = "nothing: the movements differ by no more than the noise"


@dataclass(frozen=True)
class BudgetRow:
    """A cause of error on one axis: its shares of the standard errors of scale (fraction) and bias (deg/s), and a remedy."""

    axis: str
    cause: str
    scale_se: float
    bias_se_dps: float
    advice: str

    def to_json(self) -> dict[str, Any]:
        return asdict(self)


def budget(fitted: GravityFit) -> list[BudgetRow]:
    """The rows of each axis that has a scale and a bias, the largest share of the scale's error first."""
    seen = fitted.observations
    gain = fitted.covariance @ seen.columns.T @ np.linalg.inv(fitted.noise)
    movements = seen.movement_rows
    wander = fitted.noise - seen.covariance
    at_rest = seen.covariance.copy()
    at_rest[:movements, :movements] = 0.0
    parts: dict[str, Array] = {
        "accelerometer": seen.covariance - at_rest - seen.gyro_covariance,
        "gyroscope noise": seen.gyro_covariance + np.diag(np.diag(at_rest)),
        "bias": wander + at_rest - np.diag(np.diag(at_rest)),
    }
    out = []
    for axis in AXES:
        index = {p.term.effect.role: k for k, p in enumerate(fitted.parameters) if p.term.axis == axis}
        if not {Role.SCALE, Role.BIAS} <= set(index):
            continue
        k_scale, k_bias = index[Role.SCALE], index[Role.BIAS]
        rows = []
        for cause, part in parts.items():
            scale, bias = (float(np.sqrt(max(gain[k] @ part @ gain[k], 0.0))) for k in (k_scale, k_bias))
            rows.append(BudgetRow(axis, cause, scale, bias, ADVICE[cause]))
        rows.append(BudgetRow(axis, "sample clock", CLOCK_SE, 0.0, ADVICE["sample clock"]))
        of_scale = with_role(Role.SCALE)
        excess = np.sqrt(max(fitted.misfit**2 - 1, 0.0)) * fitted.se(of_scale.id, axis, of_scale.linear[0])
        rows.append(BudgetRow(axis, "misfit", float(excess), 0.0, ADVICE["misfit"] if excess else NO_MISFIT))
        out += sorted(rows, key=lambda r: -r.scale_se)
    return out
