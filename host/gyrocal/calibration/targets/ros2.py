"""ROS 2 parameters: the calibration matrix, the bias and the noise, as a node of your own can declare them.

ROS 2 has no standard parameters for a gyroscope's calibration. The names say their units. A corrected rate is
``gyro_correction · (reading - gyro_bias)``, in the order of a row-major matrix.
"""

from __future__ import annotations

import numpy as np

from gyrocal.calibration.targets.base import (
    G_M_S2,
    RAD,
    Rendered,
    acc_densities,
    bias_dps,
    left_of,
    random_walks,
    response,
    white_densities,
)
from gyrocal.error_model.model import Model

TEXT = """\
# From the gyrocal model "{name}". Use: corrected = gyro_correction · (reading - gyro_bias_rad_s)
/**:
  ros__parameters:
    gyro_bias_rad_s: [{bias}]
    gyro_correction: [{matrix}]
"""
ACCELEROMETER = """\
    # corrected = acc_correction · (reading - acc_bias_m_s2), in the frame of the corrected rates
    acc_bias_m_s2: [{bias}]
    acc_correction: [{matrix}]
"""
NOISE = """\
    gyro_noise_density_rad_s_sqrt_hz: [{density}]
    gyro_random_walk_rad_s2_sqrt_hz: [{walk}]
    gyro_rate_hz: {rate_hz:.9g}
"""


def render(model: Model, rate_hz: float | None) -> Rendered:
    """The text of a parameter file."""
    correction = np.linalg.inv(response(model))
    text = TEXT.format(name=model.name, bias=_listed(np.multiply(bias_dps(model), RAD)), matrix=_listed(correction.ravel()))
    if (acc := model.accelerometer) is not None:
        text += ACCELEROMETER.format(bias=_listed(np.multiply(acc.bias_g, G_M_S2)), matrix=_listed(acc.correction.ravel()))
    left = left_of(model, {"scale", "bias", "misalignment", "colored_noise"}, "a constant matrix and bias cannot hold it")
    if rate_hz is None:
        return Rendered("ros2.yaml", text, {**left, "noise": "give --rate-hz, from which its density is computed"})
    noise = NOISE.format(
        density=_listed(white_densities(model, rate_hz)), walk=_listed(random_walks(model)), rate_hz=rate_hz
    )
    if densities := acc_densities(model, rate_hz):
        noise += f"    acc_noise_density_m_s2_sqrt_hz: [{_listed(densities)}]\n"
    return Rendered("ros2.yaml", text + noise, left)


def _listed(values: object) -> str:
    return ", ".join(f"{float(v):.9g}" for v in np.asarray(values, dtype=np.float64))
