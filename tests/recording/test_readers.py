"""Each format holds the same recording and gives the same session; bags and ULogs are written here, by their own rules."""

import re
import struct
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from scipy.io import savemat

from gyrocal.errors import InputError
from gyrocal.recording import readers
from gyrocal.recording.import_options import Options
from gyrocal.recording.importer import read_recording
from gyrocal.recording.readers.topics import chosen

N = 300
START_NS = 1_700_000_000_123_456_789
T_NS = START_NS + 10_000_000 * np.arange(N)
GYRO = np.random.default_rng(1).normal(0, 0.001, (N, 3))
"""Rates of a sensor at rest, whose noise is that of readings in rad/s."""
ACC = np.array([0.0, 0.0, 9.81]) + np.random.default_rng(2).normal(0, 0.01, (N, 3))


def check(path: Path, topic: str | None = None) -> None:
    """The guess finds time, rates in rad/s and accelerations in m/s2."""
    found = read_recording(path, Options(defaults={"table_rate_dps": 0.0}, topic=topic))
    run = found.session.runs[0]
    assert found.session.sample_rate_hz == pytest.approx(100, rel=1e-4)
    assert np.allclose(run.t_s, 0.01 * np.arange(N), atol=1e-6)
    assert np.allclose(run.gyro_dps, np.degrees(GYRO), atol=1e-4)
    assert run.acc_g is not None
    assert np.allclose(run.acc_g, ACC / 9.80665, atol=1e-6)


def test_npz(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", time=T_NS, gyr=GYRO, acc=ACC, fs=100.0, note=np.array("walk"))
    check(tmp_path / "a.npz")


def test_npz_with_objects_is_not_executed(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", time=T_NS, gyr=GYRO, acc=ACC, more=np.array([{"a": 1}], dtype=object))
    check(tmp_path / "a.npz")


@pytest.mark.parametrize("form", ["4", "5"])
def test_mat(tmp_path: Path, form: str) -> None:
    content: dict[str, Any] = {"time": (T_NS - START_NS) / 1e9, "gyr": GYRO.T, "acc": ACC}
    savemat(tmp_path / "a.mat", content, format=form)  # type: ignore[arg-type]
    check(tmp_path / "a.mat")


def test_mat_with_structures_and_as_text(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"imu": {"time": (T_NS - START_NS) / 1e9, "gyr": GYRO, "acc": ACC}})
    check(tmp_path / "a.mat")
    parameters = {f"{kind}_{of}": np.arange(3.0) for kind in ("arw", "vrw", "bias", "sd") for of in ("gyro", "acc")}
    savemat(tmp_path / "a.mat", {"imu": {**parameters, "t": (T_NS - START_NS) / 1e9, "wb": GYRO, "fb": ACC, "freq": 100.0}})
    check(tmp_path / "a.mat")
    np.savetxt(tmp_path / "ascii.mat", np.column_stack([np.arange(N) / 100, GYRO]), fmt="%.16e")
    columns = ["t", "x", "y", "z"]
    maps = ["t_s=t", *(f"g{a}_dps={a}:rad/s" for a in "xyz")]
    options = Options(maps, columns=columns, defaults={"table_rate_dps": 0.0})
    assert np.allclose(read_recording(tmp_path / "ascii.mat", options).session.runs[0].gyro_dps, np.degrees(GYRO))


@pytest.mark.parametrize(
    ("kind", "says"),
    [("timetable", "writetimetable(Gyro, 'Gyro.csv')"), ("table", "writetable(Gyro, 'Gyro.csv')"), ("quaternion", "arrays")],
)
def test_objects_of_matlab_say_how_to_export_them(kind: str, says: str, tmp_path: Path) -> None:
    """They are of type 17, whose name, system and class stand in the file, and whose data nobody but MATLAB knows."""

    def element(form: int, content: bytes) -> bytes:
        return struct.pack("<II", form, len(content)) + content.ljust(-(-len(content) // 8) * 8, b"\0")

    def opaque(name: str) -> bytes:
        words = b"".join(element(1, word.encode()) for word in (name, "MCOS", kind))
        flags, size = element(6, struct.pack("<II", 13, 0)), element(5, struct.pack("<ii", 6, 1))
        data = element(14, flags + size + element(1, b"") + element(6, struct.pack("<6I", 3707764736, 2, 1, 1, 1, 1)))
        return element(14, element(6, struct.pack("<II", 17, 0)) + words + data)

    objects = b"".join(map(opaque, ("Acceleration", "Gyro", "Position")))
    head = b"MATLAB 5.0 MAT-file, Platform: GLNXA64".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    (tmp_path / "a.mat").write_bytes(head + objects)
    words = rf"Gyro is an object of MATLAB's class {kind}, .*{re.escape(says)}.* Acceleration, Position"
    with pytest.raises(InputError, match=words):
        readers.read(tmp_path / "a.mat")


def test_arrays_of_other_lengths_are_told_and_the_gyroscope_s_length_is_taken(tmp_path: Path) -> None:
    """A raw buffer of another length held more numbers than the readings, which were left out in silence."""
    content = {"time": (T_NS - START_NS) / 1e9, "SENSgyro": GYRO, "s_read": np.zeros((2 * N, 12)), "late": np.zeros(N // 2)}
    savemat(tmp_path / "a.mat", content)
    source = readers.read(tmp_path / "a.mat")
    assert [name for name in source.frame.columns if "gyro" in name] == ["SENSgyro.0", "SENSgyro.1", "SENSgyro.2"]
    with pytest.raises(InputError, match=rf"no column 'late'.*of another length than these {N} rows: s_read\.0 \({2 * N}\)"):
        source.check_has(["late"])
    with pytest.raises(InputError, match=rf"true rate is not known.*of another length than these {N} rows: s_read\.0"):
        read_recording(tmp_path / "a.mat", Options())
    savemat(tmp_path / "b.mat", {"u": np.zeros(8), "v": np.zeros(5)})
    with pytest.raises(InputError, match=r"no gyroscope is recognized among u; .*rows: v \(5\)"):
        read_recording(tmp_path / "b.mat", Options(defaults={"table_rate_dps": 0.0}))


def test_mat_of_version_7_3_says_how_to_save_it(tmp_path: Path) -> None:
    (tmp_path / "a.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + b"\x89HDF\r\n\x1a\n" + bytes(100))
    with pytest.raises(InputError, match="save FILE -v7"):
        readers.read(tmp_path / "a.mat")


def write_bag(path: Path, form: str) -> None:
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if form == "1" else Stores.LATEST)
    types = store.types
    time, header, vector, quaternion, imu, text = (
        types[name]
        for name in (
            "builtin_interfaces/msg/Time", "std_msgs/msg/Header", "geometry_msgs/msg/Vector3", "geometry_msgs/msg/Quaternion",
            "sensor_msgs/msg/Imu", "std_msgs/msg/String",
        )
    )  # fmt: skip
    plugin = {"2": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}.get(form)
    writer = Writer1(path) if form == "1" else Writer2(path, version=9, storage_plugin=plugin)
    serialize = store.serialize_ros1 if form == "1" else store.serialize_cdr
    sequence = {"seq": 0} if form == "1" else {}
    with writer:
        notes = writer.add_connection("/notes", "std_msgs/msg/String", typestore=store)
        readings = writer.add_connection("/imu/data", "sensor_msgs/msg/Imu", typestore=store)
        writer.write(notes, START_NS, serialize(text("hello"), "std_msgs/msg/String"))
        for t_ns, w, a in zip(T_NS.tolist(), GYRO, ACC, strict=True):
            message = imu(
                header(stamp=time(t_ns // 10**9, t_ns % 10**9), frame_id="imu", **sequence),
                quaternion(0, 0, 0, 1), np.zeros(9), vector(*w), np.zeros(9), vector(*a), np.zeros(9),
            )  # fmt: skip
            writer.write(readings, t_ns + 5_000_000, serialize(message, "sensor_msgs/msg/Imu"))


@pytest.mark.parametrize("form", ["1", "2", "mcap"])
def test_ros_bags(tmp_path: Path, form: str, require_module: Callable[[str], None]) -> None:
    require_module("rosbags")
    path = tmp_path / ("a.bag" if form == "1" else "bag")
    write_bag(path, form)
    check(path)
    check(path, "/imu/data")
    with pytest.raises(InputError, match="no topic '/imu/dat' \\(did you mean /imu/data"):
        readers.read(path, topic="/imu/dat")
    if form == "mcap":
        check(next(path.glob("*.mcap")))


def test_a_log_without_a_topic_of_readings_is_told_so(tmp_path: Path) -> None:
    """One topic of odometry was called several topics."""
    with pytest.raises(InputError, match=r"no topic is known to hold .*; choose one by --topic: /odom$"):
        chosen(tmp_path / "a.bag", None, ["/odom"], [])


def ulog(path: Path) -> None:
    """A ULog as https://docs.px4.io/main/en/dev_log/ulog_file_format.html has it: header, flag bits, format, data."""

    def message(kind: bytes, content: bytes) -> bytes:
        return struct.pack("<HB", len(content), kind[0]) + content

    fields = "uint64_t timestamp;float[3] gyro_rad;float[3] accelerometer_m_s2;"
    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + message(b"B", bytes(40))
    out += message(b"F", f"sensor_combined:{fields}".encode()) + message(b"A", struct.pack("<BH", 0, 1) + b"sensor_combined")
    for i, (w, a) in enumerate(zip(GYRO, ACC, strict=True)):
        out += message(b"D", struct.pack("<HQ6f", 1, 1_000_000 + 10_000 * i, *w, *a))
    path.write_bytes(out)


def test_ulog(tmp_path: Path, require_module: Callable[[str], None]) -> None:
    require_module("pyulog")
    ulog(tmp_path / "a.ulg")
    check(tmp_path / "a.ulg")
    with pytest.raises(InputError, match="there are sensor_combined"):
        readers.read(tmp_path / "a.ulg", topic="vehicle_status")


@pytest.mark.parametrize(
    ("head", "module", "extra"),
    [
        (b"#ROSBAG V2.0\n", "rosbags.highlevel", "ros"),
        (b"\x89MCAP0\r\n", "rosbags.highlevel", "ros"),
        (b"ULog\x01\x12\x35", "pyulog", "import"),
    ],
)
def test_a_missing_package_is_named_with_its_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, head: bytes, module: str, extra: str
) -> None:
    (tmp_path / "a").write_bytes(head + bytes(50))
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError, match=rf"pip install 'gyrocal\[{extra}\]'"):
        readers.read(tmp_path / "a")


@pytest.mark.parametrize(
    "content",
    [b"PAR1" + bytes(30), b"PK\x03\x04" + bytes(30), b"MATLAB 5.0 MAT-file".ljust(137), b"\x1f\x8b\x00", b"", b"\0\0"],
)  # fmt: skip
def test_a_damaged_file_is_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a").write_bytes(content)
    with pytest.raises(InputError, match=str(tmp_path / "a")):
        readers.read(tmp_path / "a", ["t"])


@pytest.mark.parametrize("magic", [b"#ROSBAG V2.0\n", b"\x89MCAP0\r\n", b"ULog\x01\x12\x35"])
def test_a_damaged_log_is_one_line(tmp_path: Path, magic: bytes, require_module: Callable[[str], None]) -> None:
    require_module("rosbags")
    require_module("pyulog")
    (tmp_path / "a").write_bytes(magic + bytes(60))
    with pytest.raises(InputError, match=str(tmp_path / "a")):
        readers.read(tmp_path / "a")


def test_parquet(tmp_path: Path) -> None:
    names = ["gx", "gy", "gz", "ax", "ay", "az"]
    frame = pl.DataFrame(np.column_stack([GYRO, ACC]), schema=names).with_columns(time=pl.Series(T_NS).cast(pl.Datetime("ns")))
    frame.write_parquet(tmp_path / "a.parquet")
    check(tmp_path / "a.parquet")


@pytest.mark.parametrize("separator", [",", ";", "\t", " "])
def test_a_table_of_numbers_reads_as_the_same_table_beside_a_word(tmp_path: Path, separator: str) -> None:
    """A column of words that nobody maps makes all cells text, and changes no number."""
    rows = [[f"{0.01 * i:.2f}", *(f"{value:.17g}" for value in GYRO[i])] for i in range(N)]
    rows[7][2] = "1e-3" if separator == " " else ""
    maps = ["t_s=t", "gz_dps=z", "gy_dps=y"]
    found = []
    for name, words in (("numbers.csv", ()), ("words.csv", ("note", *["ok"] * N))):
        table = [["t", "x", "y", "z"], *rows]
        lines = [[*row, *words[i : i + 1]] for i, row in enumerate(table)]
        (tmp_path / name).write_text("\n".join(map(separator.join, lines)), encoding="utf-8")
        found.append(read_recording(tmp_path / name, Options(maps, defaults={"table_rate_dps": 0.0})).session.runs[0])
    assert found[0].table.equals(found[1].table)
    assert len(found[0]) == (N if separator == " " else N - 1)
