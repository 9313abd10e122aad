"""The ROS 2 node, with a stub of rclpy: what it publishes for what comes, by the model."""

import json
import math
import sys
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from gyrocal import ros_node
from gyrocal.api import Model
from gyrocal.error_model.accelerometer import AccelerometerModel
from gyrocal.error_model.model import Term
from gyrocal.noise.axis import AxisNoise

RAD = math.pi / 180
MATRIX = np.array([[1.02, 0.0, 0.0], [0.004, 0.99, 0.0], [-0.003, 0.006, 1.01]])
LAYOUTS = Path(__file__).resolve().parents[1] / "docs" / "layouts"


@dataclass
class Vector:
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


@dataclass
class Imu:
    header: str = "stamp"
    angular_velocity: Vector = field(default_factory=Vector)
    linear_acceleration: Vector = field(default_factory=Vector)
    angular_velocity_covariance: list[float] = field(default_factory=lambda: [0.0] * 9)
    linear_acceleration_covariance: list[float] = field(default_factory=lambda: [0.0] * 9)


@dataclass
class Temperature:
    temperature: float


@dataclass
class Value:
    value: Any


@dataclass
class Ros:
    """What a stub of ROS saw: parameters given, subscriptions by topic, messages published, warnings."""

    parameters: dict[str, Any] = field(default_factory=dict)
    subscribed: dict[str, Any] = field(default_factory=dict)
    published: list[tuple[str, Any]] = field(default_factory=list)
    warned: list[str] = field(default_factory=list)
    play: list[tuple[str, Any]] = field(default_factory=list)
    down: bool = False


@pytest.fixture
def ros(monkeypatch: pytest.MonkeyPatch) -> Ros:
    seen = Ros()

    class Node:
        def __init__(self, name: str) -> None:
            assert name == "imu_calibrated"

        def declare_parameter(self, name: str, default: Any) -> Value:
            return Value(seen.parameters.get(name, default))

        def create_publisher(self, kind: type, topic: str, depth: int) -> Any:
            assert kind is Imu
            return type("Publisher", (), {"publish": staticmethod(lambda message: seen.published.append((topic, message)))})

        def create_subscription(self, kind: type, topic: str, callback: Any, qos: Any) -> None:
            seen.subscribed[topic] = callback

        def get_logger(self) -> Any:
            return type("Logger", (), {"warning": staticmethod(seen.warned.append)})

        def destroy_node(self) -> None:
            seen.down = True

    def spin(node: Node) -> None:
        for topic, message in seen.play:
            seen.subscribed[topic](message)
        raise KeyboardInterrupt

    modules = {
        "rclpy": {"init": lambda args=None: None, "spin": spin, "try_shutdown": lambda: None}, "rclpy.node": {"Node": Node},
        "rclpy.qos": {"qos_profile_sensor_data": "sensor data"}, "sensor_msgs": {},
        "sensor_msgs.msg": {"Imu": Imu, "Temperature": Temperature},
    }  # fmt: skip
    for name, content in modules.items():
        module = ModuleType(name)
        module.__dict__.update(content)
        monkeypatch.setitem(sys.modules, name, module)
    return seen


@pytest.fixture
def model(tmp_path: Path) -> Model:
    terms = (
        Term("scale", "z", {"scale": 0.01}), Term("bias", "z", {"bias_dps": 0.5}),
        Term("bias_temperature", "z", {"k1_dps_per_c": 0.02}),
    )  # fmt: skip
    acc = AccelerometerModel.of(MATRIX, np.zeros((3, 3)), np.array([0.01, -0.03, 0.05]), np.zeros(3), np.full(3, 0.002))
    made = replace(Model("m", terms, dict.fromkeys("xyz", AxisNoise(0.05))), accelerometer=acc)
    made.save(tmp_path / "m.toml")
    return made


def raw(z_dps: float = 80.0) -> Imu:
    return Imu("first", Vector(0.1, 0.2, z_dps * RAD), Vector(1.0, -2.0, 9.0))


def test_messages_are_corrected_by_the_model(ros: Ros, model: Model, tmp_path: Path) -> None:
    ros.parameters["model"] = str(tmp_path / "m.toml")
    given = raw()
    ros.play = [("imu/data_raw", given), ("imu/temperature", Temperature(30.0)), ("imu/data_raw", raw())]
    ros_node.main([])
    (topic, cold), (_, warm) = ros.published
    assert topic == "imu/data_calibrated"
    assert cold.header == "first"
    assert cold.angular_velocity.z == pytest.approx(RAD * (80 - 0.5) / 1.01)
    assert warm.angular_velocity.z == pytest.approx(RAD * (80 - 0.5 - 5 * 0.02) / 1.01)
    expected = np.linalg.solve(MATRIX, np.array([1.0, -2.0, 9.0]) - 9.80665 * np.array([0.01, -0.03, 0.05]))
    found = warm.linear_acceleration
    assert [found.x, found.y, found.z] == pytest.approx(expected)
    assert warm.angular_velocity_covariance[8] == pytest.approx((0.05 * RAD) ** 2)
    assert warm.linear_acceleration_covariance[::4] == pytest.approx([(0.002 * 9.80665) ** 2] * 3)
    assert given == raw(), "the raw message stays as it came"
    assert ros.down


def test_this_power_cycle_s_bias_may_be_given(ros: Ros, model: Model, tmp_path: Path) -> None:
    ros.parameters = {"model": str(tmp_path / "m.toml"), "bias_dps": [math.nan, 0.0, 2.0]}
    ros.play = [("imu/data_raw", raw())]
    ros_node.main([])
    assert ros.published[0][1].angular_velocity.z == pytest.approx(RAD * (80 - 2) / 1.01)


@pytest.mark.parametrize(
    ("parameters", "says"),
    [({}, "name the model's file"), ({"model": "none.toml"}, "none.toml"), ({"model": "M", "bias_dps": [1.0]}, "give three")],
)
def test_what_is_missing_is_told_in_one_line(
    ros: Ros, model: Model, tmp_path: Path, parameters: dict[str, Any], says: str
) -> None:
    ros.parameters = {k: str(tmp_path / "m.toml") if v == "M" else v for k, v in parameters.items()}
    with pytest.raises(SystemExit, match=says):
        ros_node.main([])
    assert ros.down


def test_without_ros_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rclpy", None)
    with pytest.raises(SystemExit, match="it needs rclpy of ROS 2"):
        ros_node.main([])


def test_the_layouts_show_its_topics() -> None:
    fields = [f"{part}.{axis}" for part in ("angular_velocity", "linear_acceleration") for axis in "xyz"]
    wanted = {(f"/{topic}", name) for topic in (ros_node.RAW, ros_node.CALIBRATED) for name in fields}
    juggler = ET.parse(LAYOUTS / "plotjuggler.xml").getroot()
    curves = [c.attrib["name"] for c in juggler.iter("curve")]
    assert set(curves) == {f"{topic}/{name.replace('.', '/')}" for topic, name in wanted}
    foxglove = json.loads((LAYOUTS / "foxglove.json").read_text(encoding="utf-8"))
    paths = [path["value"] for panel in foxglove["configById"].values() for path in panel["paths"]]
    assert set(paths) == {f"{topic}.{name}" for topic, name in wanted}

    def panels(part: Any) -> set[str]:
        return {part} if isinstance(part, str) else panels(part["first"]) | panels(part["second"])

    assert panels(foxglove["layout"]) == set(foxglove["configById"])
