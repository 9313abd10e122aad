"""Rates that an autopilot has corrected before it logged them, told from others by the names of their columns.

PX4 logs the sensor's own rates in ``sensor_gyro`` and ``sensor_gyro_fifo``. From those of its other topics it has subtracted
the offsets, and turned them into the vehicle's frame. Versions before 1.11, whose ``sensor_gyro`` also had counts (``x_raw``),
did the first in the driver. ArduPilot does both before it logs ``IMU`` and ``GYR``. Both send corrected rates by MAVLink.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

PX4_TOPICS = ("sensor_combined", "vehicle_angular_velocity", "vehicle_imu", "vehicle_attitude", "vehicle_odometry")
PX4, ARDUPILOT, MAVLINK = "PX4", "ArduPilot", "MAVLink"
"""What a session's key ``corrected`` begins with."""
FIELD = r"(?:.*[^A-Za-z])?"
"""What may stand before the name of a field: its message or topic."""
BESIDE_ARDUPILOT = ("TimeUS", "SampleUS", "EG", "GyHlt", "GHz", "ErrG")
"""Fields that ArduPilot logs beside its rates."""


def corrected_by(taken: Sequence[str], columns: Sequence[str], file: Path, topic: str = "") -> str | None:
    """What had corrected the rates in the columns ``taken`` of a table with these ``columns``; None for a sensor's own rates.

    ``file`` is that of the table, and ``topic`` the one of a file with several.
    """

    def any_taken(pattern: str) -> bool:
        return any(re.fullmatch(pattern, name) for name in taken)

    stem = file.name.partition(".")[0]
    for name in PX4_TOPICS:
        if any_taken(rf"{name}(?:\.\d+)?\..*") or re.search(rf"_{name}_\d+$", stem):  # as ulog2csv names its files
            return f"{PX4} {name}"
    if any_taken(FIELD + r"gyro_rad\[\d\]"):
        return f"{PX4} {PX4_TOPICS[0]}"
    if any_taken(r"sensor_gyro(?:\.\d+)?\.[xyz]") and any(name.endswith("x_raw") for name in columns):
        return f"{PX4} sensor_gyro, before version 1.11"
    beside = any(re.fullmatch(FIELD + name, column) for column in columns for name in BESIDE_ARDUPILOT)
    if beside and any_taken(FIELD + "Gyr[XYZ]"):
        return f"{ARDUPILOT} IMU"
    if any_taken(FIELD + "[xyz]gyro") or "mavros/imu" in topic:
        return f"{MAVLINK} IMU"
    return None
