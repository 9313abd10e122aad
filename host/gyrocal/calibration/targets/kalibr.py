"""Kalibr's ``imu.yaml``: the noise of the gyroscope as continuous-time densities.

Source: Kalibr's IMU noise model. ``gyroscope_noise_density`` in rad/s/sqrt(Hz) is the standard deviation of a sample divided by
the square root of the sample rate, which is the one-sided density of a datasheet divided by sqrt(2).
"""

from __future__ import annotations

from gyrocal.calibration.targets.base import Rendered, acc_densities, left_of, needs_rate, random_walks, white_densities, worst
from gyrocal.error_model.model import Model

TEXT = """\
# Noise of the gyroscope for Kalibr, from the gyrocal model "{name}". The values are those of the noisiest axis.
{note}rostopic: /imu0
update_rate: {rate_hz:.9g}  # Hz
gyroscope_noise_density: {density:.6e}  # rad/s/sqrt(Hz)
{comment}gyroscope_random_walk: {walk}  # rad/s^2/sqrt(Hz)
{acc_comment}accelerometer_noise_density: {acc}  # m/s^2/sqrt(Hz)
# accelerometer_random_walk:  # m/s^3/sqrt(Hz)
"""


NOTE = "# Kalibr also needs {what}, which this model does not have: fill in the lines that begin with #.\n"
INFLATED = "# The white noise is {factor:g} times, and the random walk is {factor:g} times, what was measured.\n"


def render(model: Model, rate_hz: float | None, factor: float) -> Rendered:
    """The text of ``imu.yaml``; all noise is multiplied by a factor."""
    rate = needs_rate(rate_hz, "kalibr")
    walk, acc = factor * worst(random_walks(model)), factor * worst(acc_densities(model, rate))
    note = NOTE.format(what="the accelerometer's random walk" if acc else "the accelerometer's values")
    note += "" if factor == 1 else INFLATED.format(factor=factor)
    text = TEXT.format(
        name=model.name, rate_hz=rate, density=factor * worst(white_densities(model, rate)),
        comment="" if walk else "# ", note=note, acc_comment="" if acc else "# ", acc=f"{acc:.6e}" if acc else "",
        walk=f"{walk:.6e}" if walk else "",
    )  # fmt: skip
    left = left_of(model, {"colored_noise"}, "Kalibr's imu.yaml holds noise only")
    if not acc:
        left["accelerometer"] = "the model does not know its noise; add it to the file"
    else:
        left["accelerometer_random_walk"] = "a session by hand does not show it; add it to the file"
    if not walk:
        left["gyroscope_random_walk"] = "the model has no drift, and Kalibr takes no 0; record longer, or fill it in"
    return Rendered("imu.yaml", text, left)
