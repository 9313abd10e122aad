"""ArduPilot parameters: offsets of a gyroscope, and its temperature calibration as a cubic without a constant.

Source: ArduPilot's parameter reference and its ``AP_InertialSensor``. ``INS_GYROFFS_X`` and the others are in rad/s.
``INS_TCAL1_GYRk_X`` is the coefficient of the k-th power of the temperature above 35 degC, in 1e-6 rad/s/degC^k. It subtracts
the cubic at the part's temperature and adds that at ``INS_GYR1_CALTEMP``, the temperature of the offsets; unset, that is -300.
It clips both temperatures to ``INS_TCAL1_TMIN`` and ``INS_TCAL1_TMAX``. The offsets of the second and third gyroscope are
``INS_GYR2OFFS_X`` and ``INS_GYR3OFFS_X``. ``INS_ACCOFFS_X`` (m/s^2) is subtracted from an acceleration, which is then
multiplied by ``INS_ACCSCAL_X``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

from gyrocal.calibration.targets.base import (
    CORRECTED_ACC,
    RAD,
    Rendered,
    acc_offsets,
    bias_polynomial,
    coefficients,
    has_thermal_bias,
    left_of,
)
from gyrocal.calibration.vehicle import Existing, Vehicle, common
from gyrocal.error_model.fitted_on import Range
from gyrocal.error_model.model import Model
from gyrocal.recording.corrected import ARDUPILOT
from gyrocal.recording.session import AXES

AUTOPILOT = ARDUPILOT
GYROSCOPES = range(1, 4)
REFERENCE_C = 35.0
SCALE = 1e6
UNSET_C, DEFAULT_RANGE_C = -300.0, (0.0, 70.0)
TURNED_BY = ("AHRS_ORIENTATION",)
HEADER = """\
# Gyroscope {n} for ArduPilot, from the gyrocal model "{name}". Offsets in rad/s at {at_c:.9g} degC.
# ArduPilot calibrates the offsets again at each start unless INS_GYR_CAL is 0. The axes are the IMU's after its rotation to the
# board.
"""
WITHOUT_RANGE = "the model does not keep its range of temperature; set it on the vehicle, so that 35 °C lies in it"


@dataclass(frozen=True)
class _Before:
    """What a vehicle subtracts already: constant offsets, rad/s, and a cubic over temperature if it uses one."""

    existing: Existing
    n: int

    @property
    def compensated(self) -> bool:
        """True if the vehicle compensates the temperature of this gyroscope."""
        return int(self.existing.values.get(f"INS_TCAL{self.n}_ENABLE", 0)) == 1

    @property
    def range_c(self) -> Range:
        """The temperatures to which the vehicle clips, degC."""
        names = f"INS_TCAL{self.n}_TMIN", f"INS_TCAL{self.n}_TMAX"
        low, high = (self.existing.values.get(name, end) for name, end in zip(names, DEFAULT_RANGE_C, strict=True))
        return low, high

    def cubic(self, axis: str) -> Polynomial:
        """The cubic of an axis, rad/s, in powers of the temperature above 35 degC."""
        powers = [self.existing.value(f"INS_TCAL{self.n}_GYR{k}_{axis.upper()}") / SCALE for k in (1, 2, 3)] * self.compensated
        return Polynomial([0.0, *powers])

    def offset(self, axis: str, at_c: float) -> float:
        """What is subtracted from an axis at a temperature in the range, rad/s."""
        own_c = np.clip(self.existing.values.get(f"INS_GYR{self.n}_CALTEMP", UNSET_C), *self.range_c)
        cubic = self.cubic(axis)
        return self.existing.value(offset_name(self.n, axis)) + float(cubic(at_c - REFERENCE_C) - cubic(own_c - REFERENCE_C))


def offset_name(n: int, axis: str) -> str:
    """The parameter of a gyroscope's offset."""
    return f"INS_GYR{'' if n == 1 else n}OFFS_{axis.upper()}"


def render(model: Model, vehicle: Vehicle) -> Rendered:
    """The text of a parameter file."""
    n, thermal = vehicle.number(GYROSCOPES[0], GYROSCOPES[-1]), has_thermal_bias(model)
    ids = {m: f"INS_GYR{'' if m == 1 else m}_ID" for m in GYROSCOPES}
    device_id = vehicle.known_id(ids, n)
    before = None
    if vehicle.existing is not None:
        vehicle.existing.check_upright(TURNED_BY)
        before = _Before(vehicle.existing, n)
    left = left_of(model, {"bias", "bias_temperature"}, "ArduPilot corrects a gyroscope's offset only")
    values: list[tuple[str, float]] = [] if device_id is None else [(ids[n], device_id)]
    at_c = REFERENCE_C
    if thermal:
        values.append((f"INS_TCAL{n}_ENABLE", 1))
        if model.fitted_on.temp_c is None:
            left[f"INS_TCAL{n}_TMIN and TMAX"] = WITHOUT_RANGE
        else:
            low_c, high_c = model.fitted_on.temp_c
            if before is not None and before.compensated:
                low_c, high_c = common((low_c, high_c), before.range_c, before.existing.file)
            at_c = float(np.clip(REFERENCE_C, low_c, high_c))
            values += [(f"INS_TCAL{n}_TMIN", low_c), (f"INS_TCAL{n}_TMAX", high_c)]
        values.append((f"INS_GYR{n}_CALTEMP", at_c))
    for axis in AXES:
        values += _of_axis(model, n, axis, at_c, before, thermal=thermal)
    values += _accelerometer(model, n, vehicle, left)
    lines = [f"{name},{value if isinstance(value, int) else f'{value:.9g}'}" for name, value in values]
    return Rendered("ardupilot.param", HEADER.format(n=n, name=model.name, at_c=at_c) + "\n".join([*lines, ""]), left)


def _accelerometer(model: Model, n: int, vehicle: Vehicle, left: dict[str, str]) -> list[tuple[str, float]]:
    """Offsets and factors of the accelerometer; what cannot be held is added to ``left``."""
    known, which = acc_offsets(model), f"INS_ACC{'' if n == 1 else n}"
    if known and vehicle.existing is not None:
        left["accelerometer"] = CORRECTED_ACC
        return []
    if known:
        left[f"{which}_ID"] = "the vehicle has it once its accelerometer was calibrated there; it must be this sensor's"
        left["misalignment of the accelerometer"] = "ArduPilot corrects an accelerometer's offset and scale only"
    offsets = [(f"{which}OFFS_{axis.upper()}", offset) for axis, offset, _ in known]
    return offsets + [(f"{which}SCAL_{axis.upper()}", factor) for axis, _, factor in known]


def _of_axis(
    model: Model, n: int, axis: str, at_c: float, before: _Before | None, *, thermal: bool
) -> list[tuple[str, float]]:  # fmt: skip
    """The offset of an axis at a temperature, if the model has its bias, and its cubic with what the vehicle has already."""
    own = Polynomial([c * RAD for c in bias_polynomial(model, axis, REFERENCE_C)])
    values = []
    if axis in model.bias_dps:
        offset = float(own(at_c - REFERENCE_C))
        if before is not None:
            offset += before.offset(axis, at_c) if thermal else before.existing.value(offset_name(n, axis))
        values.append((offset_name(n, axis), offset))
    if thermal:
        _, *powers = coefficients(own + (before.cubic(axis) if before else 0.0))
        values += [(f"INS_TCAL{n}_GYR{k}_{axis.upper()}", c * SCALE) for k, c in enumerate(powers, start=1)]
    return values
