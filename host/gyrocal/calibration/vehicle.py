"""The gyroscope's parameters on a vehicle that flies PX4 or ArduPilot: which of its gyroscopes, and what it has already."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from gyrocal.error_model.fitted_on import Range
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.files import UNREADABLE, read_small_text
from gyrocal.recording.corrected import ARDUPILOT, PX4

LARGEST_BYTES = 4_000_000
BITS = 32
"""Of a device's id."""


@dataclass(frozen=True)
class Existing:
    """The parameters of a vehicle by name, and the file that they are from."""

    file: str
    values: Mapping[str, float]

    def value(self, name: str) -> float:
        """A parameter. Raises InputError if the file lacks it."""
        if name not in self.values:
            raise InputError(f"{self.file}: there is no {name}; save all parameters of the vehicle to the file")
        return self.values[name]

    def device_id(self, name: str) -> int | None:
        """The id in a parameter; None if it is not set."""
        return int(self.values.get(name, 0.0)) % 2**BITS or None

    def check_upright(self, names: tuple[str, ...]) -> None:
        """Raise InputError if one of the parameters turns the rates into another frame than that of the offsets."""
        turned = next((name for name in names if self.values.get(name, 0.0) != 0.0), None)
        if turned is not None:
            raise InputError(
                f"{self.file}: {turned} is {self.values[turned]:g}, so the logged rates are turned against the offsets; fit "
                "the model on the sensor's own rates"
            )


@dataclass(frozen=True)
class Vehicle:
    """Which gyroscope of the vehicle is meant; ``existing`` are the parameters to which a model is added, if it is to be."""

    device_id: int | None = None
    index: int | None = None
    existing: Existing | None = None

    def __post_init__(self) -> None:
        if self.device_id is not None and not 0 < self.device_id < 2**BITS:
            raise InputError(f"--device-id {self.device_id}: an id of a device is from 1 to {2**BITS - 1}")

    def number(self, first: int, last: int) -> int:
        """The index of the gyroscope, by default the first."""
        if self.index is not None and not first <= self.index <= last:
            raise InputError(f"--index {self.index}: there are {first} to {last}")
        return first if self.index is None else self.index

    def known_id(self, names: Mapping[int, str], index: int) -> int | None:
        """The id of the sensor with this index: the given one, or that of the vehicle. ``names`` are parameters by index.

        Raises InputError if the vehicle has this id under another index, or another id under this one.
        """
        if self.existing is None:
            return self.device_id
        found = {i: self.existing.device_id(name) for i, name in names.items()}
        if self.device_id is None or found[index] == self.device_id:
            return found[index]
        of_id = next((i for i, known in found.items() if known == self.device_id), None)
        instead = "" if of_id is None else f"; the id is that of --index {of_id}"
        if of_id is not None or found[index] is not None:
            raise InputError(f"{self.existing.file}: {names[index]} is {found[index] or 0}, not {self.device_id}{instead}")
        return self.device_id


def signed(device_id: int) -> int:
    """An id as the parameter of 32 bits with a sign that autopilots store."""
    return device_id - 2**BITS if device_id >= 2 ** (BITS - 1) else device_id


def existing_of(model: Model, autopilot: str, add_to: str | Path | None) -> Existing | None:
    """The parameters that had corrected the readings of a model's session; None for a sensor's own readings.

    Raises InputError if the one is given and the other is not the case.
    """
    corrected = model.fitted_on.corrected
    if not corrected:
        if add_to is not None:
            raise InputError(f"--add-to {add_to}: the model {model.name!r} is of the sensor's own rates; leave --add-to out")
        return None
    others = {PX4, ARDUPILOT} - {autopilot}
    if corrected.split(" ")[0] in others:
        raise InputError(f"the model {model.name!r} was fitted on rates of {corrected}, not of {autopilot}")
    if add_to is None:
        raise InputError(
            f"the model {model.name!r} was fitted on rates that were corrected already ({corrected}), and its offsets alone "
            "would undo that; give the vehicle's parameters by --add-to FILE, or fit the model on the sensor's own rates"
        )
    return read_parameters(Path(add_to))


def read_parameters(path: Path) -> Existing:
    """A file of parameters as QGroundControl, Mission Planner or MAVProxy save it. Raises InputError if it holds none."""
    try:
        text = read_small_text(path, LARGEST_BYTES)
    except UNREADABLE as error:
        reason = getattr(error, "strerror", None) or "not a text file"
        raise InputError(f"--add-to {path}: {reason}; give the parameters that the vehicle had when it was recorded") from None
    values: dict[str, float] = {}
    for line in text.splitlines():
        words = line.partition("#")[0].replace(",", " ").split()
        words = words[2:] if len(words) == 5 else words  # vehicle, component, name, value, type
        number = _number(words[1]) if len(words) > 1 else None
        if number is not None:
            values[words[0]] = number
    if not values:
        raise InputError(f"--add-to {path}: no parameters in it; save those of the vehicle, as QGroundControl does")
    return Existing(str(path), values)


def _number(word: str) -> float | None:
    try:
        value = float(word)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def common(of_model: Range, of_vehicle: Range, file: str) -> Range:
    """The temperatures that are in both ranges, degC. Raises InputError if there are none; ``file`` is the vehicle's."""
    low, high = max(of_model[0], of_vehicle[0]), min(of_model[1], of_vehicle[1])
    if low >= high:
        raise InputError(
            f"{file}: the vehicle compensates {of_vehicle[0]:.4g} to {of_vehicle[1]:.4g} °C, and the model was fitted on "
            f"{of_model[0]:.4g} to {of_model[1]:.4g} °C: record at temperatures that both have"
        )
    return low, high
