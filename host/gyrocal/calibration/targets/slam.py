"""The noise of the IMU for visual-inertial SLAM: ORB-SLAM3, OpenVINS and VINS-Mono or VINS-Fusion, in one YAML file.

ORB-SLAM3 (``IMU.*``) and OpenVINS (Kalibr's names) take densities. VINS takes the standard deviation of a sample (``gyr_n``,
``acc_n``) and, as its equations multiply the random walk by the time step and not by its root, a density times the root of the
rate (``gyr_w``).
"""

from __future__ import annotations

import math

from gyrocal.calibration.targets.base import Rendered, acc_densities, left_of, needs_rate, random_walks, white_densities, worst
from gyrocal.error_model.model import Model

HEADER = """\
# Noise of the IMU from the gyrocal model "{name}", that of the noisiest axis{times}.
# Copy the block of your program into its file. Lines that begin with # are what the model does not know.
"""
BLOCKS = {
    "ORB-SLAM3": ("IMU.Frequency", "IMU.NoiseGyro", "IMU.GyroWalk", "IMU.NoiseAcc", "IMU.AccWalk"),
    "OpenVINS": (
        "update_rate", "gyroscope_noise_density", "gyroscope_random_walk", "accelerometer_noise_density",
        "accelerometer_random_walk",
    ),
    "VINS-Mono and VINS-Fusion": ("", "gyr_n", "gyr_w", "acc_n", "acc_w"),
}  # fmt: skip
UNITS = ("Hz", "rad/s/sqrt(Hz)", "rad/s^2/sqrt(Hz)", "m/s^2/sqrt(Hz)", "m/s^3/sqrt(Hz)")
OF_SAMPLES = ("Hz", "rad/s, of a sample", "rad/s^2, of a step", "m/s^2, of a sample", "m/s^3, of a step")


def render(model: Model, rate_hz: float | None, factor: float) -> Rendered:
    """The text of ``slam.yaml``; all noise is multiplied by a factor."""
    rate = needs_rate(rate_hz, "slam")
    measured = (worst(white_densities(model, rate)), worst(random_walks(model)), worst(acc_densities(model, rate)), 0.0)
    noise = [factor * value for value in measured]
    text = HEADER.format(name=model.name, times="" if factor == 1 else f", {factor:g} times")
    for program, names in BLOCKS.items():
        of_samples = program.startswith("VINS")
        values = [rate, *(v * math.sqrt(rate) if of_samples else v for v in noise)]
        text += f"\n# {program}\n"
        for name, value, unit in zip(names, values, OF_SAMPLES if of_samples else UNITS, strict=True):
            known = f"{name}: {value:.6g}" if value else f"# {name}:"
            text += f"{known}  # {unit}\n" if name else ""
    left = left_of(model, {"colored_noise"}, "it holds noise only; correct the readings (`gyrocal apply`, Model.corrector)")
    if not measured[2]:
        left["accelerometer"] = "the model does not know its noise; add it to the file"
    return Rendered("slam.yaml", text, left)
