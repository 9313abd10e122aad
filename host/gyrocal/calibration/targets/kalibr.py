"""Kalibr's ``imu.yaml``: the noise of the gyroscope as continuous-time densities.

Source: Kalibr's IMU noise model. ``gyroscope_noise_density`` in rad/s/sqrt(Hz) is the standard deviation of a sample divided by
the square root of the sample rate, which is the one-sided density of a datasheet divided by sqrt(2).
"""

from __future__ import annotations

from gyrocal.calibration.targets.base import Rendered, left_of, needs_rate, random_walks, white_densities, worst
from gyrocal.error_model.model import Model

TEXT = """\
# Noise of the gyroscope for Kalibr, from the gyrocal model "{name}". The values are those of the noisiest axis.
# Kalibr also needs the accelerometer's values, which this model does not have: fill in the lines that begin with #.
rostopic: /imu0
update_rate: {rate_hz:.9g}  # Hz
gyroscope_noise_density: {density:.6e}  # rad/s/sqrt(Hz)
{comment}gyroscope_random_walk: {walk}  # rad/s^2/sqrt(Hz)
# accelerometer_noise_density:  # m/s^2/sqrt(Hz)
# accelerometer_random_walk:  # m/s^3/sqrt(Hz)
"""


def render(model: Model, rate_hz: float | None) -> Rendered:
    """The text of ``imu.yaml``."""
    rate = needs_rate(rate_hz, "kalibr")
    walk = worst(random_walks(model))
    text = TEXT.format(
        name=model.name, rate_hz=rate, density=worst(white_densities(model, rate)), comment="" if walk else "# ",
        walk=f"{walk:.6e}" if walk else "",
    )  # fmt: skip
    left = left_of(model, {"colored_noise"}, "Kalibr's imu.yaml holds noise only")
    left["accelerometer"] = "the model does not know its noise; add it to the file"
    if not walk:
        left["gyroscope_random_walk"] = "the model has no drift, and Kalibr takes no 0; record longer, or fill it in"
    return Rendered("imu.yaml", text, left)
