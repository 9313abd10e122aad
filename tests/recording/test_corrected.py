"""Rates that an autopilot has corrected are told from a sensor's own, and the session and its model remember it."""

import json
import struct
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyrocal.cli import main
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.inference.fit import fit
from gyrocal.recording.import_options import Options
from gyrocal.recording.importer import import_recording, read_recording
from gyrocal.recording.session import Session

N, RATE_HZ = 400, 100.0
RNG = np.random.default_rng(5)
OFFSET = np.array([0.02, -0.01, 0.03])
RAW = OFFSET + RNG.normal(0, 1e-3, (N, 3))
US = 1_000_000 + (1e6 / RATE_HZ * np.arange(N)).astype(np.int64)
FIELDS = {
    "sensor_gyro": ("uint32_t device_id;float x;float y;float z;float temperature;", "I4f"),
    "sensor_combined": ("float[3] gyro_rad;float[3] accelerometer_m_s2;", "6f"),
    "vehicle_angular_velocity": ("uint64_t timestamp_sample;float[3] xyz;", "Q3f"),
}
VALUES: Mapping[str, Callable[[int], tuple[float, ...]]] = {
    "sensor_gyro": lambda i: (3_932_169, *RAW[i], 31.5), "sensor_combined": lambda i: (*(RAW[i] - OFFSET), 0.0, 0.0, -9.81),
    "vehicle_angular_velocity": lambda i: (int(US[i]), *(RAW[i] - OFFSET)),
}  # fmt: skip


def ulog(path: Path, *topics: str, old: bool = False, every: int = 1) -> Path:
    """A ULog of these topics, by https://docs.px4.io/main/en/dev_log/ulog_file_format.html; ``old``: with the raw counts.

    Of the first topic only one sample of ``every`` is logged.
    """

    def message(kind: bytes, content: bytes) -> bytes:
        return struct.pack("<HB", len(content), kind[0]) + content

    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + message(b"B", bytes(40))
    counts = "int16_t x_raw;" if old else ""
    for topic in topics:
        out += message(b"F", f"{topic}:uint64_t timestamp;{FIELDS[topic][0]}{counts}".encode())
    for number, topic in enumerate(topics):
        out += message(b"A", struct.pack("<BH", 0, number) + topic.encode())
    for i in range(N):
        for number, topic in enumerate(topics):
            if number == 0 and i % every:
                continue
            counted = ("h", (7,)) if old else ("", ())
            values = (*VALUES[topic](i), *counted[1])
            out += message(b"D", struct.pack(f"<HQ{FIELDS[topic][1]}{counted[0]}", number, US[i], *values))
    path.write_bytes(out)
    return path


def imported(path: Path, topic: str | None = None) -> Session:
    return read_recording(path, Options(defaults={"table_rate_dps": 0.0}, topic=topic)).session


@pytest.fixture(autouse=True)
def _pyulog(require_module: Callable[[str], None]) -> None:
    require_module("pyulog")


@pytest.mark.parametrize("topics", [("sensor_combined", "sensor_gyro"), ("sensor_gyro", "vehicle_angular_velocity")])
def test_the_sensor_s_own_rates_are_taken_first(tmp_path: Path, topics: tuple[str, ...]) -> None:
    session = imported(ulog(tmp_path / "a.ulg", *topics))
    assert session.corrected is None
    assert session.runs[0].gyro_dps == pytest.approx(np.degrees(RAW), abs=1e-4)
    assert session.runs[0].temp_c == pytest.approx(np.full(N, 31.5))


@pytest.mark.parametrize("topic", ["sensor_combined", "vehicle_angular_velocity"])
def test_corrected_topics_are_said_to_be_corrected(
    tmp_path: Path, topic: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = ulog(tmp_path / "a.ulg", "sensor_gyro", topic)
    arguments = ["import", str(path), str(tmp_path / "lab"), "--topic", topic, "--rate", "0", "--yes", "--json"]
    assert main(arguments) == 0
    (warning,) = [w for w in json.loads(capsys.readouterr().out)["warnings"] if w["code"] == "corrected_already"]
    assert topic in warning["text"]
    assert not warning["blocking"]
    assert f'corrected = "PX4 {topic}"' in (tmp_path / "lab" / "session.toml").read_text()
    session = Session.open(tmp_path / "lab")
    assert session.unread == ()
    model = fit(session, Model.builtin("paper")).model
    model.save(tmp_path / "m.toml")
    assert Model.open(tmp_path / "m.toml").fitted_on.corrected == f"PX4 {topic}"


def test_sensor_gyro_of_an_old_px4_was_corrected_by_its_driver(tmp_path: Path) -> None:
    assert str(imported(ulog(tmp_path / "a.ulg", "sensor_gyro", old=True)).corrected).startswith("PX4 sensor_gyro")


@pytest.mark.parametrize(
    ("file", "names", "corrected"),
    [
        ("imu.csv", ("timestamp", "TimeUS", "I", "GyrX", "GyrY", "GyrZ"), "ArduPilot IMU"),
        ("imu.csv", ("IMU.TimeUS", "IMU.GyrX", "IMU.GyrY", "IMU.GyrZ"), "ArduPilot IMU"),
        ("log_sensor_combined_0.csv", ("timestamp", "gyro_rad[0]", "gyro_rad[1]", "gyro_rad[2]"), "PX4 sensor_combined"),
        ("log_vehicle_angular_velocity_0.csv", ("timestamp", "xyz[0]", "xyz[1]", "xyz[2]"), "PX4 vehicle_angular_velocity"),
        ("mav.csv", ("time_usec", "HIGHRES_IMU.xgyro", "HIGHRES_IMU.ygyro", "HIGHRES_IMU.zgyro"), "MAVLink IMU"),
        ("log_sensor_gyro_0.csv", ("timestamp", "x", "y", "z"), None),
        ("vehicle_imu.csv", ("t", "gx", "gy", "gz"), None),
        ("dot.csv", ("SampleTimeFine", "Gyr_X", "Gyr_Y", "Gyr_Z"), None), ("watch.csv", ("time", "GyrX", "GyrY", "GyrZ"), None),
    ],
)  # fmt: skip
def test_tables_made_of_logs(tmp_path: Path, file: str, names: tuple[str, ...], corrected: str | None) -> None:
    time = next(name for name in names if "ime" in name or name == "t")
    others = {name: np.zeros(N, dtype=np.int64) for name in names[:-3]}
    rates = {name: RAW[:, i] for i, name in enumerate(names[-3:])}
    pl.DataFrame({**others, time: US, **rates}).select(names).write_csv(tmp_path / file)
    maps = [f"t_s={time}:us", *(f"g{a}_dps={name}:rad/s" for a, name in zip("xyz", names[-3:], strict=True))]
    found = read_recording(tmp_path / file, Options(maps, defaults={"table_rate_dps": 0.0}))
    assert found.session.corrected == corrected


def test_a_topic_that_px4_logs_now_and_then_is_passed_over(tmp_path: Path) -> None:
    path = ulog(tmp_path / "a.ulg", "sensor_gyro", "sensor_combined", every=50)
    assert str(imported(path).corrected).startswith("PX4 sensor_combined")
    assert imported(path).rows == N
    assert imported(path, "sensor_gyro").rows == N // 50


def test_a_session_holds_no_readings_of_both_kinds(tmp_path: Path) -> None:
    both = ulog(tmp_path / "a.ulg", "sensor_gyro", "sensor_combined")
    maps = ["t_s=sensor_gyro.timestamp:us", *(f"g{a}_dps=sensor_gyro.{a}:rad/s" for a in "xyz")]
    import_recording(both, tmp_path / "lab", maps, table_rate_dps=0.0)
    options = Options(cuts=(), defaults={"table_rate_dps": 0.0}, topic="sensor_combined")
    with pytest.raises(InputError, match="a session cannot hold a sensor's own readings and readings of PX4 sensor_combined"):
        read_recording(both, options, Session.open(tmp_path / "lab"))


@pytest.mark.parametrize("names", [("timestamp", "x", "y", "z"), ("timestamp", "gyro_rad[0]", "gyro_rad[1]", "gyro_rad[2]")])
def test_runs_added_to_a_session_keep_its_key(tmp_path: Path, names: tuple[str, ...]) -> None:
    table = pl.DataFrame({names[0]: US, **{name: RAW[:, i] for i, name in enumerate(names[1:])}})
    maps = [f"t_s={names[0]}:us", *(f"g{a}_dps={name}:rad/s" for a, name in zip("xyz", names[1:], strict=True))]
    for name in ("one", "two"):
        table.write_csv(tmp_path / f"{name}.csv")
        import_recording(tmp_path / f"{name}.csv", tmp_path / "lab", maps, table_rate_dps=0.0, append=name == "two")
    assert Session.open(tmp_path / "lab").corrected == (None if "x" in names else "PX4 sensor_combined")
    assert len(Session.open(tmp_path / "lab").runs) == 2
