"""A rendered target, and what several targets need of a model: noise densities and the bias as a polynomial in temperature."""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gyrocal.calibration.targets import targets
from gyrocal.calibration.vehicle import Vehicle, existing_of
from gyrocal.effects.quantities import REFERENCE_C
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.recording.session import AXES

RAD = math.pi / 180
G_M_S2 = 9.80665
"""Standard gravity: one g in m/s^2."""
ORDERS = 4
"""Number of coefficients of a cubic."""


@dataclass(frozen=True)
class Rendered:
    """A file for another program. ``left`` maps what it cannot hold to the reason. ``more`` are further files by name."""

    file: str
    text: str
    left: Mapping[str, str]
    more: Mapping[str, str] = field(default_factory=dict)

    @property
    def files(self) -> dict[str, str]:
        """The texts of all files by name."""
        return {self.file: self.text, **self.more}


CORRECTED_ACC = "the vehicle had corrected the accelerations of the model's session; fit it on the sensor's own"
INFLATED = ("kalibr", "slam")
"""The targets whose users multiply the noise of a quiet room, because estimators take it for all that disturbs a sensor."""


def render(
    name: str, model: Model, rate_hz: float | None = None, *, device_id: int | None = None, index: int | None = None,
    add_to: str | Path | None = None, noise_factor: float | None = None,
) -> Rendered:  # fmt: skip
    """A model as a target's file.

    ``device_id`` and ``index`` name the gyroscope among those of a vehicle, and ``add_to`` is a file with the vehicle's
    parameters, to which a model of readings that they have corrected is added. ``noise_factor`` multiplies the noise that a
    target of :data:`INFLATED` is told. Raises InputError for an unknown target, a model
    without values, what the target needs and is not given, and what it cannot use.
    """
    if name not in targets():
        raise InputError(f"--format {name}: there are header, {', '.join(targets())}")
    if not any(term.values for term in model.terms):
        raise InputError(f"the model {model.name!r} has no fitted values; make one with `gyrocal explain` or `gyrocal add`")
    if rate_hz is not None and not (math.isfinite(rate_hz) and rate_hz > 0):
        raise InputError(f"--rate-hz {rate_hz:g}: the sample rate must be positive")
    if noise_factor is not None and name not in INFLATED:
        raise InputError(f"--noise-factor is for --format {' and '.join(INFLATED)}")
    if noise_factor is not None and not (math.isfinite(noise_factor) and noise_factor > 0):
        raise InputError(f"--noise-factor {noise_factor:g}: must be positive")
    module = f"{__package__}.{name}"
    try:
        found = importlib.import_module(module)
    except ModuleNotFoundError:
        found = importlib.import_module(f"{module}_")
    if hasattr(found, "AUTOPILOT"):
        vehicle = Vehicle(device_id, index, existing_of(model, found.AUTOPILOT, add_to))
        of_vehicle: Rendered = found.render(model, vehicle)
        return of_vehicle
    if (device_id, index, add_to) != (None, None, None):
        raise InputError(f"--format {name}: --device-id, --index and --add-to are for px4 and ardupilot")
    factor = () if name not in INFLATED else (noise_factor or 1.0,)
    rendered: Rendered = found.render(model, rate_hz, *factor)
    return rendered


def left_of(model: Model, held: set[str], why: str) -> dict[str, str]:
    """The ids of the model's effects and noise components that the target cannot hold, each with the reason."""
    return {i: why for i in model.ids if i not in held}


def worst(values: list[float]) -> float:
    """The largest of three axes, for targets that have one number for all axes."""
    return max(values, default=0.0)


def white_densities(model: Model, rate_hz: float) -> list[float]:
    """White-noise density of each axis, rad/s/sqrt(Hz): the standard deviation of a sample over the root of the sample rate."""
    sds = [model.noise_on(axis).white_sd_dps for axis in AXES]
    return [sd * RAD / math.sqrt(rate_hz) for sd in sds if sd is not None]


def random_walks(model: Model) -> list[float]:
    """Rate random walk of each axis, rad/s^2/sqrt(Hz): an Ornstein-Uhlenbeck drift grows like it for times below tau."""
    drifts = [model.noise_on(axis).drift for axis in AXES]
    known = [(d.sd_dps, d.tau_s) for d in drifts if d is not None and d.sd_dps is not None and d.tau_s]
    return [sd * RAD * math.sqrt(2 / tau_s) for sd, tau_s in known]


def bias_dps(model: Model) -> list[float]:
    """The bias of each axis at 25 degC, deg/s; 0 where the model has none."""
    return [model.value("bias", axis, "bias_dps") for axis in AXES]


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


def acc_densities(model: Model, rate_hz: float) -> list[float]:
    """White-noise density of the accelerometer, m/s^2/sqrt(Hz); empty if the model has none."""
    known = model.accelerometer
    return [] if known is None else [sd * G_M_S2 / math.sqrt(rate_hz) for sd in known.white_sd_g if sd > 0]


def acc_offsets(model: Model) -> list[tuple[str, float, float]]:
    """The accelerometer by axis: offset (m/s^2) and factor of a reading less the offset; empty if the model has none."""
    known = model.accelerometer
    if known is None:
        return []
    return [(axis, known.bias_g[i] * G_M_S2, 1 / known.matrix[i][i]) for i, axis in enumerate(AXES)]


def bias_polynomial(model: Model, axis: str, at_c: float) -> list[float]:
    """Coefficients of the bias over temperature, dps/degC^k for k = 0 to 3, in powers of the temperature above ``at_c``."""
    names = ("k1_dps_per_c", "k2_dps_per_c2", "k3_dps_per_c3")
    about_reference = [model.value("bias", axis, "bias_dps"), *(model.value("bias_temperature", axis, n) for n in names)]
    return coefficients(np.polynomial.Polynomial(about_reference)(np.polynomial.Polynomial([at_c - REFERENCE_C, 1.0])))


def coefficients(cubic: np.polynomial.Polynomial) -> list[float]:
    """The four coefficients of a cubic; numpy leaves out those of the highest powers where they are zero."""
    return [float(c) for c in np.pad(cubic.coef, (0, ORDERS - cubic.coef.size))]


def has_thermal_bias(model: Model) -> bool:
    """True if the model knows how the bias changes with temperature."""
    return any(t.values for t in model.terms if t.effect_id == "bias_temperature")


def needs_rate(rate_hz: float | None, target: str) -> float:
    """The sample rate. Raises InputError if it is not given."""
    if rate_hz is None:
        raise InputError(f"--format {target} needs --rate-hz, from which the noise density is computed")
    return rate_hz
