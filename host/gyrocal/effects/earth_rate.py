"""The rotation of the Earth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gyrocal.effects.base import Effect, Parameter
from gyrocal.recording.session import Array, Run

EARTH_DPS = 15.041067 / 3600
OF_EARTH = 1.1
"""Amplitude of a wave once per turn, as a part of the Earth's rate, up to which it may be that rate beside noise."""


class EarthRate(Effect):
    id = "earth_rate"
    title = "The Earth's rate"
    cause = (
        "A gyroscope reads its rotation relative to the stars, and the laboratory rotates with the Earth by 15.04 degrees "
        "per hour. About a vertical axis this is 4.18 mdps times the sine of the latitude, positive face up and negative "
        "face down. It is not an error. It is computed from latitude_deg and never fitted."
    )
    equation = "±15.041067 deg/h·sin(latitude), + face up, - face down, about the table's vertical axis"
    uncorrected = "it is a true rotation and no error of the sensor"
    looks_like = "g_sensitivity of 0.004 dps/g, or bias if only one face is up"
    measure_next = "give latitude_deg in session.toml; a map is enough, as 1 degree changes the rate by 0.07 mdps at most"
    parameters = (
        Parameter(
            "latitude_deg", "deg", (0.0, 90.0), "latitude of the table; north is positive", 45.0, (-90.0, 90.0), sized=False
        ),
    )

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        known = any(run.latitude_deg is not None for run in runs)
        what = "nothing more: with latitude_deg" if known else "latitude_deg in session.toml, from which"
        return f"{what} it is computed; it is never fitted"

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return np.zeros((len(run), 0))

    def term(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return known_dps(run, axis, values["latitude_deg"])


def vertical_dps(latitude_deg: float) -> float:
    """The Earth's rate about the vertical, deg/s, positive in the north."""
    return float(EARTH_DPS * np.sin(np.deg2rad(latitude_deg)))


def in_known_rate(run: Run) -> Run:
    """The run with the Earth's rate in its table's known rate or turn; the run itself without a latitude or such a rate."""
    if run.latitude_deg is None or run.reference_dps is not None:
        return run
    own_dps = vertical_dps(run.latitude_deg)
    if run.table_rate_dps is not None:
        return run.turning(table_rate_dps=run.table_rate_dps + own_dps)
    return run if run.turn_deg is None else run.turning(turn_deg=run.turn_deg + own_dps * run.duration_s)


def known_dps(run: Run, axis: int, latitude_deg: float) -> Array:
    """The Earth's rate about an axis of the sensor, shape [n], deg/s; ``latitude_deg`` is positive in the north.

    It is zero for the axes in the table's plane, because their component rotates with the table's unknown heading.
    """
    own_dps = vertical_dps(latitude_deg) * run.face_sign
    return np.full(len(run), own_dps if axis == run.axis_index else 0.0)


def in_plane_dps(runs: Sequence[Run], axis: int) -> float:
    """Amplitude of the wave that the Earth's rate makes once per turn on an axis in the table's plane, deg/s.

    The largest of any latitude where none is stated; 0 for an axis about which a run turns.
    """
    turning = [r for r in runs if not r.rate_is_mean and np.any(r.rate_dps)]
    if not turning or any(r.axis_index == axis or r.reference_dps is not None for r in turning):
        return 0.0
    known = [r.latitude_deg for r in turning if r.latitude_deg is not None]
    return float(EARTH_DPS * np.cos(np.deg2rad(np.min(np.abs(known)) if known else 0.0)))


def may_be_in_plane(runs: Sequence[Run], axis: int, amplitude_dps: float) -> bool:
    """True if a wave once per turn is no larger than what the Earth's rate makes on an axis in the table's plane."""
    return amplitude_dps < OF_EARTH * in_plane_dps(runs, axis)
