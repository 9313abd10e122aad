"""PX4 parameters: offsets of gyroscope 0, and its temperature compensation as a cubic.

Source: PX4's parameter reference. ``CAL_GYRO0_XOFF`` and the others are in rad/s and are subtracted from the reading.
``TC_G0_Xk_i`` is the coefficient of the k-th power of the temperature above ``TC_G0_TREF`` for axis i, in rad/s/degC^k.
"""

from __future__ import annotations

from gyrocal.calibration.targets.base import RAD, Rendered, bias_polynomial, left_of
from gyrocal.effects.quantities import REFERENCE_C
from gyrocal.error_model.model import Model
from gyrocal.recording.session import AXES

FLOAT, INTEGER = 9, 6
"""MAVLink's numbers of the parameter types."""
HEADER = """\
# Gyroscope 0 for PX4, from the gyrocal model "{name}". Rates in rad/s, temperatures in degC.
# Set CAL_GYRO0_ID (and TC_G0_ID) on the vehicle to the sensor's device id, and the range TC_G0_TMIN to TC_G0_TMAX to that of
# the recording. With TC_G_ENABLE = 1, the offset comes from the temperature compensation, so CAL_GYRO0 offsets are zero.
# Vehicle-Id Component-Id Name Value Type
"""


def render(model: Model, rate_hz: float | None) -> Rendered:
    """The text of a parameter file."""
    thermal = "bias_temperature" in model.ids
    values: list[tuple[str, float, int]] = []
    for i, axis in enumerate(AXES):
        coefficients = [c * RAD for c in bias_polynomial(model, axis, REFERENCE_C)]
        values.append((f"CAL_GYRO0_{axis.upper()}OFF", 0.0 if thermal else coefficients[0], FLOAT))
        if thermal:
            values += [(f"TC_G0_X{k}_{i}", c, FLOAT) for k, c in enumerate(coefficients)]
    if thermal:
        values += [("TC_G0_TREF", REFERENCE_C, FLOAT), ("TC_G_ENABLE", 1, INTEGER)]
    lines = [f"1\t1\t{name}\t{value:.9g}\t{kind}" for name, value, kind in values]
    left = left_of(model, {"bias", "bias_temperature"}, "PX4 corrects a gyroscope's offset only")
    return Rendered("px4.params", HEADER.format(name=model.name) + "\n".join([*lines, ""]), left)
