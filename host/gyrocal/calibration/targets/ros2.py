"""ROS 2 parameters: the calibration matrix, the bias and the noise, as a node of your own can declare them.

ROS 2 has no standard parameters for a gyroscope's calibration. The names say their units. A corrected rate is
``gyro_correction · (reading - gyro_bias)``, in the order of a row-major matrix.
"""

from __future__ import annotations

import numpy as np

from gyrocal.calibration.targets.base import RAD, Rendered, bias_dps, left_of, random_walks, white_densities
from gyrocal.error_model.model import Model
from gyrocal.recording.session import AXES

TEXT = """\
# From the gyrocal model "{name}". Use: corrected = gyro_correction · (reading - gyro_bias_rad_s)
/**:
  ros__parameters:
    gyro_bias_rad_s: [{bias}]
    gyro_correction: [{matrix}]
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
    left = left_of(model, {"scale", "bias", "misalignment", "colored_noise"}, "a constant matrix and bias cannot hold it")
    if rate_hz is None:
        return Rendered("ros2.yaml", text, {**left, "noise": "give --rate-hz, from which its density is computed"})
    noise = NOISE.format(
        density=_listed(white_densities(model, rate_hz)), walk=_listed(random_walks(model)), rate_hz=rate_hz
    )
    return Rendered("ros2.yaml", text + noise, left)


def response(model: Model) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """The matrix [3, 3] from true rates to readings: 1 + scale, and misalignment beside the diagonal."""
    matrix = np.eye(3)
    turned = [i for i, axis in enumerate(AXES) if model.term("scale", axis) and "scale" in model.term("scale", axis).values]  # type: ignore[union-attr]
    for i, axis in enumerate(AXES):
        matrix[i, i] += model.value("scale", axis, "scale")
        for j, about in enumerate(AXES):
            if i != j:
                matrix[i, j] = model.value("misalignment", axis, f"m_{about}")
                matrix[i, j] += model.value("misalignment", axis, "m") if j in turned else 0.0
    return matrix


def _listed(values: object) -> str:
    return ", ".join(f"{float(v):.9g}" for v in np.asarray(values, dtype=np.float64))
