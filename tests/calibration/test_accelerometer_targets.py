"""What other programs read of a model's accelerometer, against the formula that each of them applies."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
import yaml

from gyrocal.calibration.targets.base import G_M_S2, render
from gyrocal.error_model.accelerometer import AccelerometerModel
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.noise.axis import AxisNoise
from gyrocal.noise.drift import Drift
from gyrocal.noise.power_cycles import TurnOnBias
from gyrocal.recording.session import AXES

RAD = math.pi / 180
MATRIX = np.array([[1.02, 0.0, 0.0], [0.004, 0.99, 0.0], [-0.003, 0.006, 1.01]])
BIAS_G = np.array([0.01, -0.03, 0.05])
GYRO = np.array([[1.01, 0.002, -0.004], [0.003, 0.98, 0.005], [-0.006, 0.001, 1.02]])
BIAS_DPS = np.array([0.3, -0.2, 0.5])
TRUE_G = np.array([0.3, -0.5, 0.81])


@pytest.fixture
def model() -> Model:
    terms = [Term("scale", a, {"scale": GYRO[i, i] - 1}) for i, a in enumerate(AXES)]
    terms += [Term("bias", a, {"bias_dps": BIAS_DPS[i]}) for i, a in enumerate(AXES)]
    terms += [
        Term("misalignment", a, {f"m_{b}": GYRO[i, j] for j, b in enumerate(AXES) if i != j}) for i, a in enumerate(AXES)
    ]
    noise = AxisNoise(0.05, drift=Drift(0.003, 60.0), turn_on_bias=TurnOnBias(0.4))
    acc = AccelerometerModel.of(MATRIX, 1e-4 * np.ones((3, 3)), BIAS_G, 1e-4 * np.ones(3), np.array([0.002, 0.003, 0.001]))
    return replace(Model("planted", tuple(terms), dict.fromkeys(AXES, noise)), accelerometer=acc)


def rows(text: str, separator: str, name: int, value: int) -> dict[str, float]:
    lines = [line.split(separator) for line in text.splitlines() if line and not line.startswith("#")]
    return {line[name]: float(line[value]) for line in lines}


def test_px4_and_ardupilot_subtract_the_offset_and_multiply(model: Model) -> None:
    straight = replace(model, accelerometer=replace(model.accelerometer, matrix=tuple(map(tuple, np.diag(np.diag(MATRIX))))))
    reading_m_s2 = G_M_S2 * (np.diag(MATRIX) * TRUE_G + BIAS_G)
    px4 = rows(render("px4", straight, device_id=7, index=1).text, "\t", 2, 3)
    pilot = rows(render("ardupilot", straight, index=2).text, ",", 0, 1)
    for i, axis in enumerate("XYZ"):
        true_m_s2 = pytest.approx(G_M_S2 * TRUE_G[i], abs=1e-7)
        assert (reading_m_s2[i] - px4[f"CAL_ACC1_{axis}OFF"]) * px4[f"CAL_ACC1_{axis}SCALE"] == true_m_s2
        assert (reading_m_s2[i] - pilot[f"INS_ACC2OFFS_{axis}"]) * pilot[f"INS_ACC2SCAL_{axis}"] == true_m_s2
    assert {"CAL_ACC0_ID", "misalignment of the accelerometer"} <= set(render("px4", model, device_id=7).left)
    assert "misalignment of the accelerometer" in render("ardupilot", model).left


def test_ros2_holds_matrix_and_bias(model: Model) -> None:
    read = yaml.safe_load(render("ros2", model, 100.0).text)["/**"]["ros__parameters"]
    reading = G_M_S2 * (MATRIX @ TRUE_G + BIAS_G)
    corrected = np.reshape(read["acc_correction"], (3, 3)) @ (reading - read["acc_bias_m_s2"])
    assert corrected == pytest.approx(G_M_S2 * TRUE_G, abs=1e-6)
    density = np.array([0.002, 0.003, 0.001]) * G_M_S2 / 10
    assert read["acc_noise_density_m_s2_sqrt_hz"] == pytest.approx(density)


def test_kalibr_has_the_accelerometer_s_noise_and_a_factor(model: Model) -> None:
    plain, inflated = (yaml.safe_load(render("kalibr", model, 100.0, noise_factor=f).text) for f in (None, 5.0))
    assert plain["accelerometer_noise_density"] == pytest.approx(0.003 * G_M_S2 / 10)
    assert "accelerometer_random_walk" in render("kalibr", model, 100.0).left
    for name in ("accelerometer_noise_density", "gyroscope_noise_density", "gyroscope_random_walk"):
        assert inflated[name] == pytest.approx(5 * plain[name], rel=1e-5)
    with pytest.raises(InputError, match="--noise-factor is for --format kalibr and slam"):
        render("json", model, noise_factor=2.0)


def triad(text: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """imu_tk's file: nine numbers of T, nine of K and three of B, whatever lies between them."""
    numbers = np.array(text.split(), dtype=float)
    assert len(numbers) == 21
    return numbers[:9].reshape(3, 3), numbers[9:18].reshape(3, 3), numbers[18:]


def test_imu_tk_corrects_both_triads_in_one_frame(model: Model) -> None:
    files = render("imu_tk", model).files
    (t_acc, k_acc, b_acc), (t, k, b) = triad(files["imu_tk_acc.calib"]), triad(files["imu_tk_gyro.calib"])
    assert np.diag(t_acc) == pytest.approx(1)
    assert np.diag(t) == pytest.approx(1)
    assert np.tril(t_acc, -1) == pytest.approx(0, abs=1e-12), "imu_tk's T of an accelerometer is upper triangular"
    acc = t_acc @ k_acc @ (G_M_S2 * (MATRIX @ TRUE_G + BIAS_G) - b_acc)
    rate_dps = np.array([50.0, -80.0, 120.0])
    gyro = t @ k @ (RAD * (GYRO @ rate_dps + BIAS_DPS) - b)
    assert np.linalg.norm(acc) == pytest.approx(G_M_S2 * np.linalg.norm(TRUE_G), abs=1e-6)
    assert np.linalg.norm(gyro) == pytest.approx(RAD * np.linalg.norm(rate_dps), abs=1e-8)
    assert acc @ gyro == pytest.approx(G_M_S2 * RAD * TRUE_G @ rate_dps, abs=1e-6), "one rotation for both"
    with pytest.raises(InputError, match="a session by hand"):
        render("imu_tk", replace(model, accelerometer=None))


def test_slam_says_each_program_s_own_units(model: Model) -> None:
    read = yaml.safe_load(render("slam", model, 100.0).text)
    kalibr = yaml.safe_load(render("kalibr", model, 100.0).text)
    assert read["IMU.Frequency"] == read["update_rate"] == 100
    assert read["IMU.NoiseGyro"] == pytest.approx(kalibr["gyroscope_noise_density"], rel=1e-5)
    assert read["gyroscope_random_walk"] == pytest.approx(kalibr["gyroscope_random_walk"], rel=1e-5)
    assert read["gyr_n"] == pytest.approx(0.05 * RAD, rel=1e-5), "VINS: of a sample"
    assert read["acc_n"] == pytest.approx(0.003 * G_M_S2, rel=1e-5)
    # VINS adds dt·gyr_w to the bias in each of its steps: after a second, that scatters as the random walk does
    assert math.sqrt(100) * read["gyr_w"] / 100 == pytest.approx(kalibr["gyroscope_random_walk"], rel=1e-5)
    assert "IMU.AccWalk" not in read


def test_vqf_s_arguments(model: Model) -> None:
    read = json.loads(render("vqf", model, 100.0).text)
    assert read["gyrTs"] == 0.01
    assert read["params"]["biasSigmaInit"] == 0.4
    walk_dps = 0.003 * math.sqrt(2 / 60)
    assert walk_dps * math.sqrt(read["params"]["biasForgettingTime"]) == pytest.approx(0.1)
    before = read["before"]
    rate_dps = np.array([50.0, -80.0, 120.0])
    corrected = np.array(before["gyr_matrix"]) @ (RAD * (GYRO @ rate_dps + BIAS_DPS) - before["gyr_bias"])
    assert corrected == pytest.approx(RAD * rate_dps)
    unknown = render("vqf", replace(model, noise={}), 100.0)
    assert json.loads(unknown.text)["params"] == {}
    assert {"biasSigmaInit", "biasForgettingTime"} <= set(unknown.left)


def test_json_holds_it_whole(model: Model) -> None:
    read = json.loads(render("json", model).text)["accelerometer"]
    assert read["matrix"] == MATRIX.tolist()
    assert read["bias_g"] == dict(zip(AXES, BIAS_G.tolist(), strict=True))
