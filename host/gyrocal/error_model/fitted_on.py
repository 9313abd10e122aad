"""What a model was fitted on: ranges of temperature, rate and acceleration, and what had corrected the readings before.

Nothing is known of the sensor beyond these ranges. A polynomial in the temperature grows fast there, so the temperature that a
correction sees is clamped to its range.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import polars as pl

from gyrocal.errors import InputError, did_you_mean
from gyrocal.recording.once import once_a_run
from gyrocal.recording.session import AXES, Array, Run, Session

Range = tuple[float, float]
TEMPERATURE = "temp_c"
RATES = tuple(f"rate_{axis}_dps" for axis in AXES)
ACCELERATIONS = tuple(f"a{axis}_g" for axis in AXES)
VARIABLES: Mapping[str, tuple[str, ...]] = {
    "temperature": (TEMPERATURE,), "rate": RATES, "acceleration": ACCELERATIONS,
}  # fmt: skip
"""The quantities of each variable whose ranges are kept."""
QUANTITIES = tuple(quantity for quantities in VARIABLES.values() for quantity in quantities)
PLACES = 1e6
"""Ends of ranges are rounded outward to the reciprocal of this."""


@dataclass(frozen=True)
class FittedOn:
    """Ranges by quantity (:data:`QUANTITIES`), and what had corrected the readings; both empty if nothing is known of them.

    The rate about an axis is the reading less the bias.
    """

    ranges: Mapping[str, Range] = field(default_factory=dict)
    corrected: str = ""

    @staticmethod
    def of(session: Session, bias_dps: Mapping[str, float]) -> FittedOn:
        """The ranges of a session's runs together; ``bias_dps`` gives the bias by axis, where it is known."""
        found = _union(_ranges(run) for run in session.runs)
        for axis, name in zip(AXES, RATES, strict=True):
            found[name] = _rounded(*(end - bias_dps.get(axis, 0.0) for end in found[name]))
        return FittedOn(found, session.corrected or "")

    @property
    def temp_c(self) -> Range | None:
        """The range of the temperature, degC; None if it is not known, or is a single value."""
        low, high = self.ranges.get(TEMPERATURE, (0.0, 0.0))
        return (low, high) if low < high else None

    def clamped(self, run: Run) -> Run:
        """The run with temperatures beyond the range replaced by the nearest end of the range."""
        if self.temp_c is None or run.temp_c is None:
            return run
        low, high = self.temp_c
        if np.nanmin(run.temp_c) >= low and np.nanmax(run.temp_c) <= high:
            return run
        return replace(run, path=None, frame=run.table.with_columns(pl.col(TEMPERATURE).clip(low, high)))


def together(parts: Iterable[FittedOn]) -> FittedOn:
    """What a model of several sessions was fitted on."""
    known = list(parts)
    return FittedOn(_union(p.ranges for p in known), next((p.corrected for p in known if p.corrected), ""))


def _union(parts: Iterable[Mapping[str, Range]]) -> dict[str, Range]:
    """The ranges that hold those of all parts."""
    out: dict[str, Range] = {}
    for name, (low, high) in (item for part in parts for item in part.items()):
        least, greatest = out.get(name, (low, high))
        out[name] = min(least, low), max(greatest, high)
    return out


@once_a_run
def _ranges(run: Run) -> dict[str, Range]:
    """The ranges of a run's columns, with the readings as the rates."""
    columns = {name: run.column(name) for name in (TEMPERATURE, *ACCELERATIONS)}
    columns |= {name: _middle(run.gyro_dps[:, i]) for i, name in enumerate(RATES)}
    known = {name: values[np.isfinite(values)] for name, values in columns.items() if values is not None}
    return {name: _rounded(float(values.min()), float(values.max())) for name, values in known.items() if values.size}


def _middle(values: Array) -> Array:
    """The medians of three successive values [n], among which single ones that stand out do not appear."""
    a, b, c = values, np.append(values[1:], values[-1]), np.append(values[:1], values[:-1])
    return np.asarray(np.maximum(np.minimum(a, b), np.minimum(np.maximum(a, b), c)))


def _rounded(low: float, high: float) -> Range:
    return math.floor(low * PLACES) / PLACES, math.ceil(high * PLACES) / PLACES


def parsed(raw: Any, corrected: Any, where: str) -> FittedOn:
    """The keys ``fitted_on`` and ``corrected`` of a model file. Raises InputError for other content than they may have."""
    if not isinstance(raw, dict):
        raise InputError(f"{where}: fitted_on must be a table such as {{ temp_c = [15.0, 40.0] }}")
    if not isinstance(corrected, str):
        raise InputError(f"{where}: corrected = {corrected!r}; write text in quotes")
    for name, ends in raw.items():
        if name not in QUANTITIES:
            near = did_you_mean(name, QUANTITIES)
            raise InputError(f"{where}: fitted_on has no range {name!r}{near}; it has {', '.join(QUANTITIES)}")
        numbers = isinstance(ends, list) and len(ends) == 2 and all(_is_number(end) for end in ends)
        if not numbers or ends[0] > ends[1]:
            raise InputError(f"{where}: fitted_on: {name} is {ends!r}; write the least and the greatest value, as [15.0, 40.0]")
    return FittedOn({name: (float(low), float(high)) for name, (low, high) in raw.items()}, corrected)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
