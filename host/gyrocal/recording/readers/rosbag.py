"""ROS 1 bags, ROS 2 bags (a folder) and MCAP, by ``rosbags``, which needs no ROS."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal.errors import InputError, first_line
from gyrocal.extras import needed
from gyrocal.recording.readers.topics import chosen
from gyrocal.recording.source import Source, of_arrays

MAGICS = (b"#ROSBAG V2.0", b"\x89MCAP0\r\n")
IMU = "sensor_msgs/msg/Imu"


def is_bag(head: bytes) -> bool:
    """True for the first bytes of a ROS 1 bag or an MCAP file."""
    return head.startswith(MAGICS)


def read(path: Path, topic: str | None, option: str = "--") -> Source:
    """One topic as a table: the numbers of its messages as ``field.field``, ``stamp_ns`` of their headers, ``received_ns``.

    Without ``topic`` the first one with messages of type sensor_msgs/Imu.
    """
    highlevel = needed("rosbags.highlevel", "ros", f"{path}: a bag")
    typesys = needed("rosbags.typesys", "ros", f"{path}: a bag")
    store = typesys.get_typestore(typesys.Stores.LATEST)
    try:
        with highlevel.AnyReader([path], default_typestore=store) as bag:
            types = {c.topic: c.msgtype for c in bag.connections}
            name = chosen(path, topic, list(types), [t for t, kind in types.items() if kind == IMU], option)
            connections = [c for c in bag.connections if c.topic == name]
            rows = [
                {"received_ns": stamp, **dict(_numbers(bag.deserialize(raw, c.msgtype)))}
                for c, stamp, raw in bag.messages(connections)
            ]
    except InputError:
        raise
    except Exception as error:  # rosbags raises many kinds on a damaged file
        raise InputError(f"{path}: not a readable bag: {first_line(error)}") from None
    label = f"{path}: {name}"
    if not rows:
        raise InputError(f"{label}: no messages")
    columns = {key: np.array([row.get(key, np.nan) for row in rows]) for key in rows[0]}
    return of_arrays(path, columns, label, si=True)


def _numbers(message: Any, above: str = "") -> Iterator[tuple[str, Any]]:
    """The numbers of a message by the names of its fields; arrays (covariances) are left out, a header gives ``stamp_ns``."""
    for field in message.__dataclass_fields__:
        value = getattr(message, field)
        if field == "header":
            yield "stamp_ns", value.stamp.sec * 1_000_000_000 + value.stamp.nanosec
        elif isinstance(value, bool | int | float | np.number):
            yield above + field, value
        elif hasattr(value, "__dataclass_fields__"):
            yield from _numbers(value, f"{above}{field}.")
