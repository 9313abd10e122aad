"""PX4 parameters: offsets of a gyroscope, and its temperature compensation as a cubic.

Source: PX4's parameter reference, its ``sensor_calibration`` and its ``temperature_compensation``. ``CAL_GYROn_XOFF`` and the
others are in rad/s and are subtracted from the rates of the sensor with the id ``CAL_GYROn_ID``, before their rotation to the
body. ``TC_Gn_Xk_i`` is the coefficient of the k-th power of the temperature above ``TC_Gn_TREF`` for axis i, in
rad/s/degC^k. That cubic is subtracted besides from the rates of the sensor with the id ``TC_Gn_ID``; its temperature is clipped
to ``TC_Gn_TMIN`` and ``TC_Gn_TMAX``. ``CAL_ACCn_XOFF`` (m/s^2) is subtracted from an acceleration, which is then multiplied by
``CAL_ACCn_XSCALE``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

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
from gyrocal.calibration.vehicle import Existing, Vehicle, common, signed
from gyrocal.effects.quantities import REFERENCE_C
from gyrocal.error_model.fitted_on import Range
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.recording.corrected import PX4
from gyrocal.recording.session import AXES

AUTOPILOT = PX4
GYROSCOPES = range(4)
FLOAT, INTEGER = 9, 6
"""MAVLink's numbers of the parameter types."""
TURNED_BY = ("SENS_BOARD_ROT", "SENS_BOARD_X_OFF", "SENS_BOARD_Y_OFF", "SENS_BOARD_Z_OFF")
HEADER = """\
# Gyroscope {n} for PX4, from the gyrocal model "{name}". Rates in rad/s, temperatures in degC.
{notes}# Vehicle-Id Component-Id Name Value Type
"""
THERMAL = """\
# The temperature compensation holds the whole offset, so the offsets of CAL_GYRO{n} are zero.
"""
CONSTANT = """\
# If TC_G_ENABLE is 1 and a TC_G{n}_ID is that of this sensor, its temperature compensation is subtracted besides.
"""
WITHOUT_ID = "set it on the vehicle to the sensor's device id, by which PX4 finds these offsets, or give --device-id"
Row = tuple[str, float, int]


@dataclass(frozen=True)
class _Before:
    """What a vehicle subtracts already: constant offsets, rad/s, and a cubic over temperature if it uses one."""

    existing: Existing
    n: int
    device_id: int | None

    @property
    def compensated(self) -> bool:
        """True if the vehicle compensates this gyroscope's temperature.

        Raises InputError if it does so by another index, or has a compensation of another sensor by this one.
        """
        ids = {m: self.existing.device_id(f"TC_G{m}_ID") for m in GYROSCOPES}
        by = next((m for m, known in ids.items() if known == self.device_id), self.n)
        if by != self.n or ids[self.n] not in (None, self.device_id):
            raise InputError(
                f"{self.existing.file}: TC_G{by}_ID is {ids[by]}, and CAL_GYRO{self.n}_ID is {self.device_id}; offsets and "
                "temperature compensation of a sensor must have one index"
            )
        return ids[self.n] is not None and int(self.existing.values.get("TC_G_ENABLE", 0)) == 1

    def offset(self, axis: str) -> float:
        """The constant offset of an axis, rad/s."""
        return self.existing.value(f"CAL_GYRO{self.n}_{axis.upper()}OFF")

    def cubic(self, i: int) -> Polynomial:
        """The compensation of axis i, rad/s, in powers of the temperature above 25 degC."""
        if not self.compensated:
            return Polynomial([0.0])
        of_tref = Polynomial([self.existing.value(f"TC_G{self.n}_X{k}_{i}") for k in range(4)])
        return of_tref(Polynomial([REFERENCE_C - self.existing.value(f"TC_G{self.n}_TREF"), 1.0]))

    def common(self, range_c: Range) -> Range:
        """The temperatures of a range at which the vehicle compensates too, degC; all of them if it does not."""
        if not self.compensated:
            return range_c
        low, high = (self.existing.value(f"TC_G{self.n}_T{end}") for end in ("MIN", "MAX"))
        return common(range_c, (low, high), self.existing.file)


def render(model: Model, vehicle: Vehicle) -> Rendered:
    """The text of a parameter file."""
    n, thermal = vehicle.number(GYROSCOPES[0], GYROSCOPES[-1]), has_thermal_bias(model)
    device_id = vehicle.known_id({m: f"CAL_GYRO{m}_ID" for m in GYROSCOPES}, n)
    before = None
    if vehicle.existing is not None:
        vehicle.existing.check_upright(TURNED_BY)
        before = _Before(vehicle.existing, n, device_id)
    rows: list[Row] = [] if device_id is None else [(f"CAL_GYRO{n}_ID", signed(device_id), INTEGER)]
    rows += _compensation(model, n, device_id, before) if thermal else _offsets(model, n, before)
    left = left_of(model, {"bias", "bias_temperature"}, "PX4 corrects a gyroscope's offset only")
    if device_id is None:
        left[f"CAL_GYRO{n}_ID"] = WITHOUT_ID
    notes = (THERMAL if thermal else CONSTANT).format(n=n)
    notes += f"# Set CAL_GYRO{n}_ID: {WITHOUT_ID}.\n" * (device_id is None)
    rows += _accelerometer(model, n, vehicle, left)
    lines = [f"1\t1\t{name}\t{int(value) if kind == INTEGER else f'{value:.9g}'}\t{kind}" for name, value, kind in rows]
    return Rendered("px4.params", HEADER.format(n=n, name=model.name, notes=notes) + "\n".join([*lines, ""]), left)


def _accelerometer(model: Model, n: int, vehicle: Vehicle, left: dict[str, str]) -> list[Row]:
    """Offsets and factors of the accelerometer; what cannot be held is added to ``left``."""
    known = acc_offsets(model)
    if known and vehicle.existing is not None:
        left["accelerometer"] = CORRECTED_ACC
        return []
    if known:
        left[f"CAL_ACC{n}_ID"] = "set it on the vehicle to the accelerometer's device id, by which PX4 finds these values"
        left["misalignment of the accelerometer"] = "PX4 corrects an accelerometer's offset and scale only"
    offsets = [(f"CAL_ACC{n}_{axis.upper()}OFF", offset, FLOAT) for axis, offset, _ in known]
    return offsets + [(f"CAL_ACC{n}_{axis.upper()}SCALE", factor, FLOAT) for axis, _, factor in known]


def _offsets(model: Model, n: int, before: _Before | None) -> Iterator[Row]:
    """The constant offsets of the axes that have a bias."""
    for axis, bias_dps in model.bias_dps.items():
        yield f"CAL_GYRO{n}_{axis.upper()}OFF", bias_dps * RAD + (before.offset(axis) if before else 0.0), FLOAT


def _compensation(model: Model, n: int, device_id: int | None, before: _Before | None) -> Iterator[Row]:
    """The temperature compensation. Offsets of axes without a bias stay those of the vehicle."""
    if device_id is None or model.fitted_on.temp_c is None:
        raise InputError(
            f"the model {model.name!r} has a bias over temperature, for which PX4 needs "
            + ("the sensor's id: give --device-id N, the device_id of sensor_gyro" if device_id is None else
               "the range of its temperatures: fit it again, or write fitted_on = { temp_c = [MIN, MAX] } into its file")
        )  # fmt: skip
    yield f"TC_G{n}_ID", signed(device_id), INTEGER
    for i, axis in enumerate(AXES):
        cubic = Polynomial([c * RAD for c in bias_polynomial(model, axis, REFERENCE_C)])
        cubic += before.cubic(i) if before else 0.0
        if axis in model.bias_dps:
            cubic += before.offset(axis) if before else 0.0
            yield f"CAL_GYRO{n}_{axis.upper()}OFF", 0.0, FLOAT
        for k, c in enumerate(coefficients(cubic)):
            yield f"TC_G{n}_X{k}_{i}", c, FLOAT
    low_c, high_c = before.common(model.fitted_on.temp_c) if before else model.fitted_on.temp_c
    yield from ((f"TC_G{n}_TREF", REFERENCE_C, FLOAT), (f"TC_G{n}_TMIN", low_c, FLOAT), (f"TC_G{n}_TMAX", high_c, FLOAT))
    yield "TC_G_ENABLE", 1, INTEGER
