"""The mapping of a foreign table's columns and units to a session's: ``target=(column-zero)[:unit][*factor]``."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from gyrocal.errors import InputError, did_you_mean, there_are
from gyrocal.recording.measured_rates import QUATERNION, REFERENCES
from gyrocal.recording.run import AXES
from gyrocal.recording.table import OPTIONAL, REQUIRED

TARGETS = (*REQUIRED, *OPTIONAL)
STANDARD_GRAVITY = 9.80665
NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"

_TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_RATE = {"dps": 1.0, "deg/s": 1.0, "mdps": 1e-3, "rad/s": 180.0 / math.pi, "mrad/s": 0.18 / math.pi}
_ACCELERATION = {"g": 1.0, "mg": 1e-3, "m/s2": 1.0 / STANDARD_GRAVITY, "m/s^2": 1.0 / STANDARD_GRAVITY}
_ANGLE = {"deg": 1.0, "rad": 180.0 / math.pi, "turn": 360.0, "mdeg": 1e-3, "mrad": 0.18 / math.pi}
_TEMPERATURE = {"degC": (1.0, 0.0), "C": (1.0, 0.0), "K": (1.0, -273.15), "degF": (1 / 1.8, -32 / 1.8)}

EUROC = (
    "t_s=timestamp [ns]:ns",
    *(f"g{a}_dps=w_RS_S_{a} [rad s^-1]:rad/s" for a in AXES),
    *(f"a{a}_g=a_RS_S_{a} [m s^-2]:m/s2" for a in AXES),
)
FORMATS = {"euroc": EUROC}
"""Mappings of known forms; ``euroc``: ``imu0/data.csv`` of EuRoC and the data sets that copy it."""


@dataclass(frozen=True)
class Scaling:
    """The sizes of the units ``counts`` and ``samples`` in a file: one count, and samples per second."""

    rate_hz: float | None = None
    lsb_dps: float | None = None
    lsb_g: float | None = None

    def check(self) -> None:
        """InputError naming the option whose value is not a positive number."""
        for name, size in vars(self).items():
            if size is not None and not (math.isfinite(size) and size > 0):
                raise InputError(f"--{name.replace('_', '-')}: {size} is not a positive number")


@dataclass(frozen=True)
class ColumnMap:
    """One column to take: ``value = column * factor + offset``, in the target's own unit."""

    target: str
    column: str
    factor: float = 1.0
    offset: float = 0.0
    unit: str | None = None
    """The unit as it was stated."""
    stated: str = field(default="", compare=False)
    """The mapping as it was stated, with its zero, unit and factor."""

    @property
    def text(self) -> str:
        """The mapping as an option states it."""
        return self.stated or f"{self.target}={self.column}"

    @property
    def is_angle_of_rate(self) -> bool:
        """True if an angle is mapped to a rate, which is its derivative."""
        return self.target == "rate_ref_dps" and self.unit in _ANGLE

    @staticmethod
    def parse(text: str, scaling: Scaling, option: str = "--map") -> ColumnMap:
        """Read ``target=column[:unit][*factor]`` or ``target=(column-zero)[:unit][*factor]``; ``/number`` divides.

        InputError says what is wrong with the ``option``.
        """
        target, equals, rest = text.partition("=")
        target = target.strip()
        if not equals or not rest.strip():
            raise InputError(f"{option} {text}: want TARGET=COLUMN[:UNIT][*FACTOR], for example gx_dps=gyr_x:rad/s")
        if target not in TARGETS:
            near = did_you_mean(target, TARGETS)
            listed = there_are(TARGETS, "docs/session.md")
            raise InputError(f"{option} {text}: no column {target!r} in a session{near}; {listed}")
        rest, multiplier = _factor(f"{option} {text}", rest)
        column, unit = rest.strip(), None
        units = units_of(target, scaling)
        head, colon, last = column.rpartition(":")
        if colon and head and last.strip() in units:
            column, unit = head.strip(), last.strip()
        elif colon and head and re.fullmatch(r"[A-Za-z/^2]{1,7}", last.strip()):
            raise InputError(f"{option} {text}: unit {last.strip()!r} is not known here; {target} takes {', '.join(units)}")
        scale = units[unit] if unit is not None else (1.0, 0.0)
        if scale is None:
            raise InputError(f"{option} {text}: the unit {unit} needs {'--rate-hz' if unit == 'samples' else _lsb(target)}")
        zero = 0.0
        shifted = re.fullmatch(rf"\(\s*(.*\S)\s*([-+])\s*({NUMBER})\s*\)", column)
        if shifted:
            column, zero = shifted[1], float(shifted[2] + shifted[3])
        factor = scale[0] * multiplier
        return ColumnMap(target, column, factor, scale[1] + zero * factor, unit, text.strip())


def _factor(stated: str, rest: str) -> tuple[str, float]:
    """A mapping without its factor, and that."""
    tail = re.fullmatch(rf"(.*\S)\s*([*/])\s*([-+]?{NUMBER})", rest)
    if not tail:
        return rest, 1.0
    try:
        factor = float(tail[3]) if tail[2] == "*" else 1.0 / float(tail[3])
    except (ValueError, ZeroDivisionError):
        factor = math.nan
    if not math.isfinite(factor) or factor == 0.0:
        raise InputError(f"{stated}: {tail[2]}{tail[3]} is not a usable factor")
    return tail[1], factor


def has_reference(columns: Iterable[str]) -> bool:
    """True if one of the columns is a reference of the true rate."""
    return any(name in REFERENCES for name in columns)


def mapping_of(form: str) -> tuple[str, ...]:
    """The mappings of a known form. Raises InputError if there is none of that name."""
    if form not in FORMATS:
        raise InputError(f"--format {form}: there are {', '.join(FORMATS)}; other tables by --map")
    return FORMATS[form]


def units_of(target: str, scaling: Scaling) -> dict[str, tuple[float, float] | None]:
    """Units that a target takes: name -> (factor, offset), None where an option that gives its size is missing."""

    def counted(name: str, size: float | None) -> dict[str, tuple[float, float] | None]:
        return {name: None if size is None else (size, 0.0)}

    def plain(table: Mapping[str, float]) -> dict[str, tuple[float, float] | None]:
        return {name: (factor, 0.0) for name, factor in table.items()}

    if target == "t_s":
        return plain(_TIME) | counted("samples", None if scaling.rate_hz is None else 1.0 / scaling.rate_hz)
    if target == "temp_c":
        return dict(_TEMPERATURE)
    if target in QUATERNION:
        return plain({"1": 1.0})
    if target.endswith("_deg"):
        return plain(_ANGLE)
    if target == "rate_ref_dps":
        return plain(_RATE) | plain(_ANGLE) | counted("counts", scaling.lsb_dps)
    if target.endswith("_dps"):
        return plain(_RATE) | counted("counts", scaling.lsb_dps)
    return plain(_ACCELERATION) | counted("counts", scaling.lsb_g)


def _lsb(target: str) -> str:
    return "--lsb-dps" if target.endswith("_dps") else "--lsb-g"
