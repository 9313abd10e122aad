"""ArduPilot parameters: offsets of the first gyroscope, and its temperature calibration as a cubic without a constant.

Source: ArduPilot's parameter reference. ``INS_GYROFFS_X`` and the others are in rad/s. ``INS_TCAL1_GYRk_X`` is the coefficient
of the k-th power of the temperature above 35 degC, in 1e-6 rad/s/degC^k. It subtracts the cubic at the part's temperature
and adds that at ``INS_GYR1_CALTEMP``, the temperature of the offsets; unset, that is -300 and counts as ``INS_TCAL1_TMIN``.
"""

from __future__ import annotations

from gyrocal.calibration.targets.base import RAD, Rendered, bias_polynomial, left_of
from gyrocal.error_model.model import Model
from gyrocal.recording.session import AXES

REFERENCE_C = 35.0
SCALE = 1e6
HEADER = """\
# Gyroscope 1 for ArduPilot, from the gyrocal model "{name}". Offsets in rad/s at 35 degC.
# Set INS_TCAL1_TMIN and INS_TCAL1_TMAX to the range of the recording, so that 35 degC lies in it. ArduPilot calibrates the
# offsets again at each start unless INS_GYR_CAL is 0. The axes are the IMU's after its rotation to the board.
"""


def render(model: Model, rate_hz: float | None) -> Rendered:
    """The text of a parameter file."""
    thermal = "bias_temperature" in model.ids
    values: list[tuple[str, float]] = []
    if thermal:
        values += [("INS_TCAL1_ENABLE", 1.0), ("INS_GYR1_CALTEMP", REFERENCE_C)]
    for axis in AXES:
        constant, *powers = (c * RAD for c in bias_polynomial(model, axis, REFERENCE_C))
        values.append((f"INS_GYROFFS_{axis.upper()}", constant))
        if thermal:
            values += [(f"INS_TCAL1_GYR{k}_{axis.upper()}", c * SCALE) for k, c in enumerate(powers, start=1)]
    lines = [f"{name},{value:.9g}" for name, value in values]
    left = left_of(model, {"bias", "bias_temperature"}, "ArduPilot corrects a gyroscope's offset only")
    return Rendered("ardupilot.param", HEADER.format(name=model.name) + "\n".join([*lines, ""]), left)
