"""ULog, the log of PX4, by ``pyulog``."""

from __future__ import annotations

from pathlib import Path

from gyrocal.errors import InputError, first_line
from gyrocal.extras import needed
from gyrocal.recording.readers.topics import chosen
from gyrocal.recording.source import Source, of_arrays

MAGIC = b"ULog\x01\x12\x35"
PREFERRED = ("sensor_gyro", "sensor_combined", "vehicle_angular_velocity", "vehicle_imu")
"""The sensor's own rates before those that PX4 has corrected."""
SLOWER = 0.5
"""A topic with a smaller part of the most samples is not preferred: PX4 may log a sensor's own rates once a second."""


def read(path: Path, topic: str | None, option: str = "--") -> Source:
    """One topic as a table; ``topic`` is ``name`` or ``name.instance``. Without one, PREFERRED decides."""
    pyulog = needed("pyulog", "import", f"{path}: ULog")
    try:
        log = pyulog.ULog(str(path))
    except Exception as error:  # pyulog raises many kinds on a damaged file
        raise InputError(f"{path}: not a readable ULog: {first_line(error)}") from None
    topics = {f"{d.name}.{d.multi_id}" if d.multi_id else d.name: d for d in log.data_list}
    sizes = {name: topics[name].data["timestamp"].size for name in PREFERRED if name in topics}
    dense = [name for name, size in sizes.items() if size >= SLOWER * max(sizes.values())]
    name = chosen(path, topic, list(topics), dense, option)
    columns = {f"{name}.{field}": values for field, values in topics[name].data.items()}
    return of_arrays(path, columns, f"{path}: {name}", si=True)
