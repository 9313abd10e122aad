"""How long an import takes against the reader of the format alone, in processor time. python benchmarks/import_speed.py [rows]

Each figure is the median over ``ROUNDS`` calls in a row: were they taken in turn, the one would find the memory that the other
has freed, which is half the time of a reader of arrays. Logs of messages (ROS, ULog) have ``MESSAGES_PART`` of the rows,
because their own readers take up to a minute for a million.
"""

from __future__ import annotations

import resource
import statistics
import struct
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
import polars as pl

from gyrocal.recording.import_options import Options
from gyrocal.recording.importer import read_recording

ROWS, ROUNDS, RATE_HZ = 1_000_000, 5, 200.0
MESSAGES_PART = 0.02
AIM = 2.0
"""Time of an import over that of the reader alone."""
RATE = {"table_rate_dps": 78.0}
COLUMNS = Options(maps=("t_s=t", "gx_dps=x", "gy_dps=y", "gz_dps=z", "temp_c=temp"), defaults=RATE)
ROS = Options(maps=("t_s=stamp_ns:ns", *(f"g{a}_dps=angular_velocity.{a}:rad/s" for a in "xyz")), defaults=RATE)
ULOG = Options(
    maps=("t_s=sensor_combined.timestamp:us", *(f"g{a}_dps=sensor_combined.gyro_rad[{i}]:rad/s" for i, a in enumerate("xyz"))),
    defaults=RATE,
)


def write(folder: Path, rows: int) -> None:
    """The same recording in each format."""
    from scipy.io import savemat

    rng = np.random.default_rng(0)
    columns = {"t": np.arange(rows) / RATE_HZ, **{a: np.round(rng.normal(0, 0.1, rows), 5) for a in "xyz"}}
    columns["temp"] = np.round(25 + np.cumsum(rng.normal(0, 1e-4, rows)), 3)
    frame = pl.DataFrame(columns)
    frame.write_csv(folder / "a.csv")
    frame.write_parquet(folder / "a.parquet")
    np.savez(folder / "a.npz", **columns)  # type: ignore[arg-type]
    savemat(folder / "a.mat", columns)
    few = frame.head(int(MESSAGES_PART * rows)).select("t", "x", "y", "z").to_numpy()
    write_ulog(folder / "a.ulg", few)
    for name in ("a.bag", "a.db3", "a.mcap"):
        write_bag(folder / name, few)


def write_ulog(path: Path, table: np.ndarray[Any, Any]) -> None:
    """A ULog of one topic, by PX4's description of the format."""

    def message(kind: bytes, content: bytes) -> bytes:
        return struct.pack("<HB", len(content), kind[0]) + content

    out = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + message(b"B", bytes(40))]
    out.append(message(b"F", b"sensor_combined:uint64_t timestamp;float[3] gyro_rad;"))
    out.append(message(b"A", struct.pack("<BH", 0, 1) + b"sensor_combined"))
    out += [message(b"D", struct.pack("<HQ3f", 1, 1_000_000 + round(1e6 * t), *w)) for t, *w in table.tolist()]
    path.write_bytes(b"".join(out))


def write_bag(path: Path, table: np.ndarray[Any, Any]) -> None:
    """A ROS 1 bag (``.bag``), or a ROS 2 bag in SQLite (``.db3``) or MCAP."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    first = path.suffix == ".bag"
    store = get_typestore(Stores.ROS1_NOETIC if first else Stores.LATEST)
    names = ("builtin_interfaces/msg/Time", "std_msgs/msg/Header", "geometry_msgs/msg/Vector3", "geometry_msgs/msg/Quaternion",
             "sensor_msgs/msg/Imu")  # fmt: skip
    time, header, vector, quaternion, imu = (cast(Any, store.types[name]) for name in names)
    sequence = {"seq": 0} if first else {}
    plugin = StoragePlugin.MCAP if path.suffix == ".mcap" else StoragePlugin.SQLITE3
    writer: Any = Writer1(path) if first else Writer2(path, version=9, storage_plugin=plugin)
    serialize = store.serialize_ros1 if first else store.serialize_cdr
    nine, none = np.zeros(9), vector(0.0, 0.0, 0.0)
    with writer:
        connection = writer.add_connection("/imu/data", "sensor_msgs/msg/Imu", typestore=store)
        for t_s, *w in table.tolist():
            t_ns = round(1e9 * t_s)
            head = header(stamp=time(t_ns // 10**9, t_ns % 10**9), frame_id="imu", **sequence)
            message = imu(head, quaternion(0, 0, 0, 1), nine, vector(*w), nine, none, nine)
            writer.write(connection, t_ns, serialize(message, "sensor_msgs/msg/Imu"))


def numpy_alone(path: Path) -> Any:
    with np.load(path) as archive:
        return {name: archive[name] for name in archive.files}


def scipy_alone(path: Path) -> Any:
    from scipy.io import loadmat

    return loadmat(path)


def pyulog_alone(path: Path) -> Any:
    from pyulog import ULog

    return ULog(str(path))


def rosbags_alone(path: Path) -> Any:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as bag:
        return [bag.deserialize(raw, connection.msgtype) for connection, _, raw in bag.messages()]


READERS: dict[str, tuple[str, Callable[[Path], Any], Options]] = {
    "a.csv": ("pandas", pd.read_csv, COLUMNS), "a.parquet": ("polars", pl.read_parquet, COLUMNS),
    "a.npz": ("numpy", numpy_alone, COLUMNS), "a.mat": ("scipy", scipy_alone, COLUMNS),
    "a.ulg": ("pyulog", pyulog_alone, ULOG), "a.bag": ("rosbags", rosbags_alone, ROS),
    "a.db3": ("rosbags", rosbags_alone, ROS), "a.mcap": ("rosbags", rosbags_alone, ROS),
}  # fmt: skip


def cpu_s(work: Callable[[], Any]) -> tuple[float, Any]:
    """Processor time of some work, all threads, user and system, s; and its result."""
    before = resource.getrusage(resource.RUSAGE_SELF)
    result = work()
    after = resource.getrusage(resource.RUSAGE_SELF)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, result


def main() -> int:
    rows = int(sys.argv[1]) if len(sys.argv) > 1 else ROWS
    met = True
    print("format     reader    reader s   import s   ratio   with the session's files s")
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        write(folder, rows)
        for name, (reader, alone, options) in READERS.items():
            path = folder / name
            reader_s = statistics.median(cpu_s(lambda path=path, alone=alone: alone(path))[0] for _ in range(ROUNDS))
            found = read_recording(path, options)
            import_s = statistics.median(
                cpu_s(lambda path=path, options=options: read_recording(path, options))[0] for _ in range(ROUNDS)
            )
            whole_s = import_s + cpu_s(lambda found=found, to=folder / f"{name}_session": found.save(to))[0]
            ratio = import_s / reader_s
            met &= ratio <= AIM
            print(f"{path.suffix:10s} {reader:8s}  {reader_s:9.3f}  {import_s:9.3f}   {ratio:5.2f}   {whole_s:9.3f}")
    return 0 if met else 1


if __name__ == "__main__":
    raise SystemExit(main())
