"""imu_tk's calibration files of accelerometer and gyroscope, as its ``CalibratedTriad`` saves and loads them.

Source: imu_tk's documentation of that class. A calibrated vector is ``T · K · (X - B)`` of a raw one: T is the misalignment
matrix with ones on its diagonal, K the diagonal matrix of scales, B the bias. In its frame the T of the accelerometer is upper
triangular, and in gyrocal's lower; the rotation between both frames is that of a QR factorisation.
Raw values are in m/s^2 and rad/s here.
"""

from __future__ import annotations

import numpy as np

from gyrocal.calibration.targets.base import G_M_S2, RAD, Rendered, bias_dps, left_of, response
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.recording.session import Array

ACC, GYRO = "imu_tk_acc.calib", "imu_tk_gyro.calib"


def render(model: Model, rate_hz: float | None) -> Rendered:
    """The texts of both files. Raises InputError for a model without an accelerometer, which defines the frame."""
    acc = model.accelerometer
    if acc is None:
        raise InputError(
            "--format imu_tk holds an accelerometer too, which comes with a session by hand: `gyrocal record --hands` or "
            "`gyrocal import --gravity`, then `gyrocal explain`"
        )
    rotation, upper = np.linalg.qr(acc.correction)
    signs = np.sign(np.diag(upper))
    into = (rotation * signs).T
    text = _triad(signs[:, None] * upper, np.multiply(acc.bias_g, G_M_S2))
    gyro = _triad(into @ np.linalg.inv(response(model)), np.multiply(bias_dps(model), RAD))
    left = left_of(model, {"scale", "bias", "misalignment"}, "a constant matrix and bias cannot hold it")
    return Rendered(ACC, text, left, {GYRO: gyro})


def _triad(matrix: Array, bias: Array) -> str:
    """One file: the misalignment matrix, the scale matrix and the bias, with empty lines between."""
    scale = np.diag(matrix)
    parts = (matrix / scale, np.diag(scale), bias[:, None])
    return "\n\n".join("\n".join(" ".join(f"{v:.12g}" for v in row) for row in part) for part in parts) + "\n"
