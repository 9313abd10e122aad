"""A ROS 2 node that corrects the IMU of a topic with a model: ``imu_calibrated``.

It takes ``sensor_msgs/Imu`` from ``imu/data_raw`` and publishes it on ``imu/data_calibrated``: rates and, if the model has an
accelerometer, accelerations without the sensor's errors, and the covariances of their white noise. A
``sensor_msgs/Temperature`` on ``imu/temperature`` is the temperature of the samples after it. Parameters: ``model``, its file,
and ``bias_dps``, this power cycle's bias about x, y and z (NaN: the model's).

rclpy and sensor_msgs come with ROS 2 and with no extra of this package.
"""

from __future__ import annotations

import copy
import math
from typing import Any

from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.recording.session import AXES

NAME = "imu_calibrated"
RAW, CALIBRATED, TEMPERATURE = "imu/data_raw", "imu/data_calibrated", "imu/temperature"
G_M_S2 = 9.80665
RAD = math.pi / 180
QUEUE = 50
OF_THE_MODEL = [math.nan] * 3
"""No bias of a power cycle, with the type of three numbers that ROS infers from a default."""


class Correction:
    """Corrects messages: ``sensor_msgs/Imu`` in, the same kind out."""

    def __init__(self, model: Model, bias_dps: list[float] | None = None) -> None:
        given = OF_THE_MODEL if bias_dps is None else bias_dps
        if len(given) != len(AXES):
            raise InputError(f"bias_dps has {len(given)} values; give three, about x, y and z, NaN where the model's is to be")
        self.corrector = model.corrector({a: b for a, b in zip(AXES, given, strict=True) if not math.isnan(b)})
        self.accelerometer = model.accelerometer
        self.temp_c = math.nan
        white_dps = [model.noise_on(axis).white_sd_dps for axis in AXES]
        self._gyro_variance = [(sd * RAD) ** 2 for sd in white_dps if sd is not None]
        white_g = () if model.accelerometer is None else model.accelerometer.white_sd_g
        self._acc_variance = [(sd * G_M_S2) ** 2 for sd in white_g]

    def heat(self, message: Any) -> None:
        """Take the temperature of a ``sensor_msgs/Temperature``, degC."""
        self.temp_c = float(message.temperature)

    def of(self, message: Any) -> Any:
        """The corrected message; header and orientation are those of the raw one."""
        out = copy.deepcopy(message)
        rate, acc = message.angular_velocity, message.linear_acceleration
        acc_g = [acc.x / G_M_S2, acc.y / G_M_S2, acc.z / G_M_S2]
        reading = [rate.x / RAD, rate.y / RAD, rate.z / RAD]
        x, y, z = self.corrector(reading, temp_c=self.temp_c, acc_g=acc_g)
        _set(out.angular_velocity, (x * RAD, y * RAD, z * RAD))
        if len(self._gyro_variance) == len(AXES):
            out.angular_velocity_covariance = _diagonal(self._gyro_variance)
        if self.accelerometer is not None:
            _set(out.linear_acceleration, [float(a) * G_M_S2 for a in self.accelerometer.correct(acc_g)])
            out.linear_acceleration_covariance = _diagonal(self._acc_variance)
        return out


def _set(vector: Any, values: Any) -> None:
    vector.x, vector.y, vector.z = values


def _diagonal(values: list[float]) -> list[float]:
    """A diagonal matrix [3, 3] by rows."""
    return [values[i] if i == j else 0.0 for i in range(3) for j in range(3)]


def main(args: list[str] | None = None) -> None:
    """Run the node until it is stopped."""
    try:
        import rclpy
        from rclpy.node import Node
        from rclpy.qos import qos_profile_sensor_data
        from sensor_msgs.msg import Imu, Temperature
    except ImportError as error:
        raise SystemExit(f"{NAME}: it needs {error.name} of ROS 2; source its setup file, and start the node again") from None

    rclpy.init(args=args)
    node: Any = Node(NAME)
    try:
        file = node.declare_parameter("model", "").value
        bias_dps = list(node.declare_parameter("bias_dps", OF_THE_MODEL).value)
        if not file:
            raise SystemExit(f"{NAME}: name the model's file: --ros-args -p model:=model.toml")
        correction = Correction(Model.open(file), bias_dps)
        for effect, why in correction.corrector.left.items():
            node.get_logger().warning(f"{effect} stays in the readings: {why}")
        publisher = node.create_publisher(Imu, CALIBRATED, QUEUE)
        node.create_subscription(Imu, RAW, lambda raw: publisher.publish(correction.of(raw)), qos_profile_sensor_data)
        node.create_subscription(Temperature, TEMPERATURE, correction.heat, qos_profile_sensor_data)
        rclpy.spin(node)
    except InputError as error:
        raise SystemExit(f"{NAME}: {error}") from None
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
