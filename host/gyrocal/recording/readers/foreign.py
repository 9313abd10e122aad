"""Formats that are not read here, each with the tool that turns it into one that is."""

from __future__ import annotations

from pathlib import Path

from gyrocal.errors import InputError

FOREIGN: dict[bytes, str] = {
    b"\xa3\x95\x80": "a DataFlash log of ArduPilot; make a CSV of it by pymavlink: "
    "mavlogdump.py --format csv --types IMU {path} > imu.csv",
    b"FMT, 128,": "a DataFlash log of ArduPilot as text; make a CSV of it by pymavlink: "
    "mavlogdump.py --format csv --types IMU {path} > imu.csv",
    b"H Product:Blackbox": "a blackbox log of Betaflight or INAV; make a CSV of it by blackbox-tools: blackbox_decode {path}",
    b"SQLite format 3\x00": "the data of a ROS 2 bag, which is read by its folder with metadata.yaml; give the folder, or make "
    "that file by: ros2 bag reindex {folder}",
}
"""What to do with a file, by its first bytes."""


def refuse(path: Path, head: bytes) -> None:
    """Raise InputError with the tool that converts a file, if its first bytes are those of a known format that is not read."""
    told = next((text for magic, text in FOREIGN.items() if head.startswith(magic)), None)
    if told is not None:
        raise InputError(f"{path}: {told.format(path=path, folder=path.parent)}")
