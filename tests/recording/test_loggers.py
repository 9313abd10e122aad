"""The columns of public loggers: each header is read as its program means it, and no accelerometer without gravity is taken."""

import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyrocal.recording.column_map import Scaling
from gyrocal.recording.guess import guess
from gyrocal.recording.readers import read
from gyrocal.recording.source import Source

N = 300
T_S = np.arange(N) / 100
RNG = np.random.default_rng(0)
KINDS = {
    "s": lambda k, j: f"{T_S[k]:.3f}", "ms": lambda k, j: f"{5000 + 10 * k}", "us": lambda k, j: f"{123456 + 10_000 * k}",
    "ns": lambda k, j: f"{1_650_000_000_000_000_000 + 10_000_000 * k}", "date": lambda k, j: f"2022-04-09 12:00:{T_S[k]:06.3f}",
    "n": lambda k, j: f"{k}", "x": lambda k, j: f"{RNG.normal(0, 30):.4f}", "degC": lambda k, j: f"{25 + k / 1000:.2f}",
    "rad": lambda k, j: f"{1.3 * np.sin(k / 17.3 + j) + RNG.normal(0, 0.01):.6f}",
    "deg": lambda k, j: f"{75 * np.sin(k / 17.3 + j) + RNG.normal(0, 0.1):.4f}",
    "si": lambda k, j: f"{9.81 * (0.1, 0.2, 0.97)[j] + RNG.normal(0, 0.02):.5f}",
    "g": lambda k, j: f"{(0.1, 0.2, 0.97)[j] + RNG.normal(0, 0.002):.5f}",
    "mg": lambda k, j: f"{(100, 200, 970)[j] + RNG.normal(0, 2):.2f}", "free": lambda k, j: f"{RNG.normal(0, 0.03):.4f}",
}  # fmt: skip
"""Cells of a kind in row k, of axis j."""

LOGGERS = {
    "AndroSensor": (
        "GRAVITY {} (m/s²)*si ACCELEROMETER {} (m/s²)*si LINEAR ACCELERATION {} (m/s²)*free GYROSCOPE {} (rad/s)*rad "
        "Time since start in ms =ms YYYY-MO-DD HH-MI-SS_SSS=date", ";",
        "t_s=Time since start in ms:ms gx_dps=GYROSCOPE X (rad/s):rad/s ax_g=ACCELEROMETER X (m/s²):m/s2",
    ),
    "SensorLog": (
        "loggingTime(txt)=date accelerometerAcceleration{}(G)*g gyroRotation{}(rad/s)*rad motionRotationRate{}(rad/s)*rad", ",",
        "t_s=loggingTime(txt) gx_dps=gyroRotationX(rad/s):rad/s ax_g=accelerometerAccelerationX(G):g",
    ),
    "phyphox": ('"Time (s)"=s "Gyroscope {} (rad/s)"*rad "Absolute (rad/s)"=x', ",",
                "t_s=Time (s):s gx_dps=Gyroscope X (rad/s):rad/s"),
    "OxIOD": (
        "Time=s attitude_roll(radians)=x rotation_rate_{}(radians/s)*rad gravity_{}(G)*g user_acc_{}(G)*free", ",",
        "t_s=Time:s gx_dps=rotation_rate_X(radians/s):rad/s",
    ),
    "Vicon Blue Trident": ("time_s=s a{}_m/s/s*si g{}_deg/s*deg", ",", "gx_dps=gX_deg/s:dps ax_g=aX_m/s/s:m/s2"),
    "WitMotion": ("Time(s)=s a{}(g)*g w{}(deg/s)*deg Angle{}(deg)*x T(°)=degC", "\t", "gx_dps=wX(deg/s):dps ax_g=aX(g):g"),
    "WitMotion app": ("time=date Acc{}(g)*g As{}(°/s)*deg Angle{}(°)*x", "\t", "t_s=time gx_dps=AsX(°/s):dps ax_g=AccX(g):g"),
    "WitMotion BLE": (
        "time=date Acceleration {}(g)*g Angular velocity {}(°/s)*deg Temperature(°C)=degC", ",",
        "gx_dps=Angular velocity X(°/s):dps ax_g=Acceleration X(g):g temp_c=Temperature(°C):degC",
    ),
    "MetaWear": ("epoch (ms)=ms elapsed (s)=s {}-axis (deg/s)*deg", ",", "t_s=epoch (ms):ms gx_dps=X-axis (deg/s):dps"),
    "Axivity": ("Time=date Accel-{} (g)*g Gyro-{} (d/s)*deg", ",", "t_s=Time gx_dps=Gyro-X (d/s):dps ax_g=Accel-X (g):g"),
    "DJI": (
        "Clock:offsetTime=s IMU_ATTI(0):accel{}*g IMU_ATTI(0):gyro{}*deg", ",",
        "t_s=Clock:offsetTime:s gx_dps=IMU_ATTI(0):gyroX:dps ax_g=IMU_ATTI(0):accelX:g",
    ),
    "GoPro": ('"cts"=ms "Gyroscope ({}) [rad/s]"*rad "temperature [°C]"=degC', ",",
              "t_s=cts:ms gx_dps=Gyroscope (X) [rad/s]:rad/s"),
    "OpenLog Artemis": ("rtcTime=date a{}*mg g{}*deg imu_degC=degC", ",", "t_s=rtcTime gx_dps=gX:dps ax_g=aX:mg"),
    "Delsys": ('X[s]=s "Avanti 1: Gyro.{} 1"*deg "Avanti 1: Acc.{} 1"*g', ",",
               "t_s=X[s]:s gx_dps=Avanti 1: Gyro.X 1:dps ax_g=Avanti 1: Acc.X 1:g"),
    "Noraxon": ("time=s Gyroscope Sensor 1 {} (deg/s)*deg", ",", "gx_dps=Gyroscope Sensor 1 X (deg/s):dps"),
    "ST": ("timestamp[us]=us acc_{}[mg]*mg gyro_{}[dps]*deg", ",", "gx_dps=gyro_X[dps]:dps ax_g=acc_X[mg]:mg"),
    "Analog Devices": ("SAMPLE_CNT=n {}GYRO_OUT*deg {}ACCL_OUT*mg", ",", "gx_dps=XGYRO_OUT:dps ax_g=XACCL_OUT:mg"),
    "Betaflight": ('"time"=us "gyroADC[{0}]"*deg "gyroUnfilt[{0}]"*deg', ",", "t_s=time:us gx_dps=gyroADC[0]:dps"),
    "Inertial Sense": ("time=s pqr[{0}]*deg acc[{0}]*si", ",", "gx_dps=pqr[0]:dps ax_g=acc[0]:m/s2"),
    "VectorNav": ("TimeStartup=ns Gyro{}*deg Accel{}*si Temp=degC", ",",
                  "t_s=TimeStartup:ns gx_dps=GyroX:dps ax_g=AccelX:m/s2"),
    "APDM": ("Time (s)=s Static/Acceleration/{} (m/s^2)*si Static/Angular Velocity/{} (rad/s)*rad", ",",
             "t_s=Time (s):s gx_dps=Static/Angular Velocity/X (rad/s):rad/s ax_g=Static/Acceleration/X (m/s^2):m/s2"),
    "axes counted from 1": ("Sample_Time=s gyr{1}*deg acc{1}*si", ";", "t_s=Sample_Time:s gx_dps=gyr1:dps ax_g=acc1:m/s2"),
    "rates counted from 0": ("t=s w{0}*deg", ",", "t_s=t:s gx_dps=w0:dps"),
    "axis first": ("time=s {}_gyro*deg {}_acc*si", ",", "gx_dps=X_gyro:dps ax_g=X_acc:m/s2"),
    "Physics Toolbox": ("time=s gF{}*g a{}*free w{}*deg", ",", "gx_dps=wX:dps ax_g=gFX:g"),
    "UZH-FPV": ("# timestamp=s ang_vel_{}*deg lin_acc_{}*si", " ", "t_s=timestamp:s gx_dps=ang_vel_X:dps ax_g=lin_acc_X:m/s2"),
}  # fmt: skip
"""Columns ``name=kind``, or three of them ``name*kind``; the separator; what they must be taken for."""


def table(columns: str, separator: str) -> str:
    names, kinds = [], []
    for name, mark, kind in re.findall(r"(.+?)([=*])(\w+)(?: |$)", columns):
        for j, axis in enumerate("XYZ" if mark == "*" else "-"):
            names.append(name.replace("{0}", str(j)).replace("{1}", str(j + 1)).replace("{}", axis))
            kinds.append((KINDS[kind], j))
    head = separator.join(names) if not names[0].startswith("# ") or separator != " " else " ".join(names)
    return "\n".join([head, *(separator.join(cell(k, j) for cell, j in kinds) for k in range(N))]) + "\n"


def of_axis(column: str, axis: int) -> str:
    """The name of a column of the axis x or 0 or 1 with another axis in its place."""
    counted = re.sub(r"(?<=[a-z\[])[01](?=\]?:)", lambda m: str(int(m[0]) + axis), column)
    return re.sub(r"X(?![a-z])", "XYZ"[axis], counted) if axis else column


@pytest.mark.parametrize("logger", LOGGERS)
def test_the_columns_of_a_logger_are_what_its_program_means(logger: str, tmp_path: Path) -> None:
    columns, separator, expected = LOGGERS[logger]
    path = tmp_path / "log.csv"
    path.write_text(table(columns, separator))
    found = {g.map.partition("=")[0]: g.map for g in guess(read(path), Scaling(), reference=False)}
    targets = {"t_s": ["t_s"], "gx_dps": [f"g{a}_dps" for a in "xyz"], "ax_g": [f"a{a}_g" for a in "xyz"], "temp_c": ["temp_c"]}
    for wanted in re.split(r" (?=(?:t_s|gx_dps|ax_g|temp_c)=)", expected):
        for j, target in enumerate(targets[wanted.partition("=")[0]]):
            column = of_axis(wanted.partition("=")[2], j)
            assert found.get(target) == f"{target}={column}", found
    if "ax_g=" not in expected:
        assert "ax_g" not in found or logger == "OxIOD", found


def test_a_slow_topic_of_px4_is_in_microseconds() -> None:
    """By its steps alone, a topic that is logged once a second was taken for one of 1000 Hz in nanoseconds."""
    rates = {f"sensor_gyro.{a}": [0.1] * 6 for a in "xyz"}
    table = pl.DataFrame({"sensor_gyro.timestamp": 10**8 + 10**6 * np.arange(6), **rates})
    assert guess(Source("a.ulg", table, si=True), Scaling())[0].map == "t_s=sensor_gyro.timestamp:us"


def test_an_acceleration_without_gravity_is_not_taken(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(table("time=s user_acc_{}(G)*free w{}*deg", ","))
    assert not [g for g in guess(read(path), Scaling()) if g.map.startswith("a")]
