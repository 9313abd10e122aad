"""What other programs read of a model: names, units and numbers, against the formula that the target applies."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from gyrocal.calibration.targets.base import bias_polynomial, render, targets
from gyrocal.cli import main
from gyrocal.effects import base
from gyrocal.error_model.correction import correct_frame
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.noise.axis import AxisNoise
from gyrocal.noise.drift import Drift
from gyrocal.recording.session import AXES

RAD = math.pi / 180
CURVE = {"k1_dps_per_c": 0.02, "k2_dps_per_c2": -0.001, "k3_dps_per_c3": 1e-5}


def planted(thermal: bool = True) -> Model:
    terms = [Term("scale", a, {"scale": s}) for a, s in zip(AXES, (0.01, -0.02, 0.015), strict=True)]
    terms += [Term("bias", a, {"bias_dps": b}) for a, b in zip(AXES, (0.3, -0.2, 0.5), strict=True)]
    terms += [Term("misalignment", "x", {"m_y": 0.01, "m_z": -0.02})]
    if thermal:
        terms.append(Term.of(base.effect("bias_temperature"), "z", CURVE))
    noise = AxisNoise(0.05, drift=Drift(0.003, 60.0))
    return Model("planted", tuple(terms), dict.fromkeys(AXES, noise))


def parameters(text: str, separator: str, name: int, value: int) -> dict[str, float]:
    """The values of a parameter file by name."""
    rows = [line.split(separator) for line in text.splitlines() if line and not line.startswith("#")]
    return {row[name]: float(row[value]) for row in rows}


def test_kalibr_reads_its_yaml() -> None:
    """The density is the sample's standard deviation over the root of the rate, in rad/s (Kalibr's IMU noise model)."""
    rendered = render("kalibr", planted(), 200.0)
    read = yaml.safe_load(rendered.text)
    assert rendered.file == "imu.yaml"
    assert read["update_rate"] == 200.0
    assert read["gyroscope_noise_density"] == pytest.approx(0.05 * RAD / math.sqrt(200.0))
    assert read["gyroscope_random_walk"] == pytest.approx(0.003 * RAD * math.sqrt(2 / 60))
    assert {"scale", "bias", "misalignment", "accelerometer"} <= set(rendered.left)
    with pytest.raises(InputError, match="--rate-hz"):
        render("kalibr", planted())


def test_kalibr_is_given_no_random_walk_of_zero() -> None:
    """Kalibr stops at a value that is not positive, so a model without drift leaves the line to be filled in."""
    model = planted()
    still = replace(model, noise={axis: replace(model.noise_on(axis), drift=None) for axis in "xyz"})
    rendered = render("kalibr", still, 200.0)
    assert "gyroscope_random_walk" not in yaml.safe_load(rendered.text)
    assert "gyroscope_random_walk" in rendered.left


def test_the_random_walk_is_that_of_the_drift_for_short_times() -> None:
    """An Ornstein-Uhlenbeck process with variance s^2 moves by 2·s^2·(1 - exp(-t/tau)), about (2·s^2/tau)·t for short t."""
    walk = yaml.safe_load(render("kalibr", planted(), 200.0).text)["gyroscope_random_walk"]
    t_s = 0.6
    moved = 2 * (0.003 * RAD) ** 2 * -np.expm1(-t_s / 60)
    assert walk**2 * t_s == pytest.approx(moved, rel=0.01)


@pytest.mark.parametrize("temp_c", [-10.0, 25.0, 60.0])
def test_px4_computes_the_bias_of_the_model(temp_c: float) -> None:
    """PX4's offset: the sum of TC_G0_Xk_i·(T - TC_G0_TREF)^k, in rad/s."""
    read = parameters(render("px4", planted()).text, "\t", 2, 3)
    offset = sum(read[f"TC_G0_X{k}_2"] * (temp_c - read["TC_G0_TREF"]) ** k for k in range(4)) + read["CAL_GYRO0_ZOFF"]
    warm = temp_c - 25
    assert offset / RAD == pytest.approx(0.5 + 0.02 * warm - 0.001 * warm**2 + 1e-5 * warm**3)
    assert parameters(render("px4", planted(thermal=False)).text, "\t", 2, 3)["CAL_GYRO0_XOFF"] == pytest.approx(0.3 * RAD)


@pytest.mark.parametrize("temp_c", [-10.0, 35.0, 60.0])
def test_ardupilot_computes_the_bias_of_the_model(temp_c: float) -> None:
    """ArduPilot's offset: INS_GYROFFS plus 1e-6 times the cubic above 35 degC, less that at the temperature of the offsets.

    Both temperatures are clipped to INS_TCAL1_TMIN and TMAX; a temperature of the offsets that is not set is -300.
    """
    read = parameters(render("ardupilot", planted()).text, ",", 0, 1)

    def cubic(at_c: float) -> float:
        d = min(max(at_c, -20.0), 70.0) - 35.0
        return 1e-6 * sum(read[f"INS_TCAL1_GYR{k}_Z"] * d**k for k in (1, 2, 3))

    offset = read["INS_GYROFFS_Z"] + cubic(temp_c) - cubic(read.get("INS_GYR1_CALTEMP", -300.0))
    warm = temp_c - 25
    assert offset / RAD == pytest.approx(0.5 + 0.02 * warm - 0.001 * warm**2 + 1e-5 * warm**3)
    assert all(len(name) <= 16 for name in read)  # MAVLink's longest parameter name


def test_px4_names_fit_mavlink() -> None:
    assert all(len(name) <= 16 for name in parameters(render("px4", planted()).text, "\t", 2, 3))


def test_ros2_gives_the_same_rates_as_the_correction() -> None:
    read = yaml.safe_load(render("ros2", planted(thermal=False), 100.0).text)["/**"]["ros__parameters"]
    matrix = np.reshape(read["gyro_correction"], (3, 3))
    reading = np.random.default_rng(1).normal(0, 60, (50, 3))
    table = np.column_stack([np.arange(50) / 100, reading])
    expected = correct_frame(planted(thermal=False), table)[:, 1:]
    assert (reading - np.divide(read["gyro_bias_rad_s"], RAD)) @ matrix.T == pytest.approx(expected, abs=1e-6)
    assert read["gyro_noise_density_rad_s_sqrt_hz"] == pytest.approx([0.05 * RAD / 10] * 3)


def test_json_holds_everything() -> None:
    rendered = render("json", planted(), 145.0)
    read = json.loads(rendered.text)
    assert rendered.left == {}
    assert {e["effect"] for e in read["effects"]} == set(planted().ids)
    curve = next(e for e in read["effects"] if e["effect"] == "bias_temperature")
    assert {n: p["value"] for n, p in curve["parameters"].items()} == CURVE
    assert curve["parameters"]["k1_dps_per_c"]["unit"] == "dps/degC"


def test_the_bias_polynomial_is_shifted_exactly() -> None:
    at_25, at_40 = (bias_polynomial(planted(), "z", at) for at in (25.0, 40.0))
    assert np.polyval(at_25[::-1], 15.0) == pytest.approx(at_40[0])
    assert np.polyval(at_25[::-1], 25.0) == pytest.approx(np.polyval(at_40[::-1], 10.0))


def test_the_command_and_its_refusals(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    planted().save(tmp_path / "m.toml")
    common = ["export", "--model", str(tmp_path / "m.toml"), "--out", str(tmp_path / "out")]
    for name in targets():
        assert main([*common, "--format", name, "--rate-hz", "145", "--json"]) == 0
        told = json.loads(capsys.readouterr().out)
        assert all(Path(file).is_file() for file in told["files"])
        assert all(set(one) == {"effect", "why"} for one in told["left"])
    assert main([*common, "--format", "betaflight"]) == 2
    assert "there are header" in capsys.readouterr().err
    assert main([*common, "--format", "kalibr", "--rate-hz", "-1"]) == 2
    assert main(["export", "--format", "px4", "--out", str(tmp_path / "out")]) == 2
    with pytest.raises(InputError, match="no fitted values"):
        render("px4", Model.builtin("default"))
