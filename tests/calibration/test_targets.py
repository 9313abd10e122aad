"""What other programs read of a model: names, units and numbers, against the formula that the target applies."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from gyrocal.calibration.targets import targets
from gyrocal.calibration.targets.base import bias_polynomial, render
from gyrocal.cli import main
from gyrocal.effects import base
from gyrocal.error_model.correction import correct_frame
from gyrocal.error_model.fitted_on import FittedOn
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.noise.axis import AxisNoise
from gyrocal.noise.drift import Drift
from gyrocal.recording.session import AXES

RAD = math.pi / 180
CURVE = {"k1_dps_per_c": 0.02, "k2_dps_per_c2": -0.001, "k3_dps_per_c3": 1e-5}


RANGE_C = (-12.5, 61.25)
DEVICE_ID = 3_932_169


def planted(thermal: bool = True, corrected: str = "") -> Model:
    terms = [Term("scale", a, {"scale": s}) for a, s in zip(AXES, (0.01, -0.02, 0.015), strict=True)]
    terms += [Term("bias", a, {"bias_dps": b}) for a, b in zip(AXES, (0.3, -0.2, 0.5), strict=True)]
    terms += [Term("misalignment", "x", {"m_y": 0.01, "m_z": -0.02})]
    if thermal:
        terms.append(Term.of(base.effect("bias_temperature"), "z", CURVE))
    noise = AxisNoise(0.05, drift=Drift(0.003, 60.0))
    return Model("planted", tuple(terms), dict.fromkeys(AXES, noise), FittedOn({"temp_c": RANGE_C}, corrected))


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


def clamped_bias_dps(temp_c: float, low_c: float = RANGE_C[0], high_c: float = RANGE_C[1]) -> float:
    """The bias of the planted model on z, beyond its range that at its end."""
    warm = min(max(temp_c, low_c), high_c) - 25
    return 0.5 + 0.02 * warm - 0.001 * warm**2 + 1e-5 * warm**3


def px4_offset(read: dict[str, float], i: int, temp_c: float, device_id: int, n: int = 0) -> float:
    """What PX4 subtracts from axis i of a sensor, rad/s: TC's cubic and CAL's offset, each of the slot with its id."""
    offset = 0.0
    if read.get("TC_G_ENABLE") == 1 and read.get(f"TC_G{n}_ID") == device_id:
        above = min(max(temp_c, read[f"TC_G{n}_TMIN"]), read[f"TC_G{n}_TMAX"]) - read[f"TC_G{n}_TREF"]
        offset = sum(read[f"TC_G{n}_X{k}_{i}"] * above**k for k in range(4))
    return offset + read[f"CAL_GYRO{n}_{'XYZ'[i]}OFF"] * (read.get(f"CAL_GYRO{n}_ID") == device_id)


@pytest.mark.parametrize("index", [0, 2])
@pytest.mark.parametrize("temp_c", [-40.0, -10.0, 25.0, 60.0, 85.0])
def test_px4_computes_the_bias_of_the_model(temp_c: float, index: int) -> None:
    """PX4's offset: the sum of TC_Gn_Xk_i·(T - TC_Gn_TREF)^k, in rad/s, the temperature clipped to the model's."""
    read = parameters(render("px4", planted(), device_id=DEVICE_ID, index=index).text, "\t", 2, 3)
    assert px4_offset(read, 2, temp_c, DEVICE_ID, index) / RAD == pytest.approx(clamped_bias_dps(temp_c))
    assert (read[f"TC_G{index}_TMIN"], read[f"TC_G{index}_TMAX"]) == RANGE_C


def test_px4_s_constant_offsets() -> None:
    read = parameters(render("px4", planted(thermal=False), device_id=DEVICE_ID).text, "\t", 2, 3)
    assert px4_offset(read, 0, 25.0, DEVICE_ID) == pytest.approx(0.3 * RAD)
    assert not [name for name in read if name.startswith("TC_")]


def test_px4_never_writes_what_would_empty_the_vehicle_s_offsets() -> None:
    """PX4 finds a compensation by its id and range; without them, offsets of zero would be all that is left."""
    with pytest.raises(InputError, match="give --device-id"):
        render("px4", planted())
    with pytest.raises(InputError, match="fitted_on") as told:
        render("px4", replace(planted(), fitted_on=FittedOn()), device_id=DEVICE_ID)
    assert "\n" not in str(told.value)
    rendered = render("px4", planted(thermal=False), index=1)
    assert "Set CAL_GYRO1_ID" in rendered.text
    assert "--device-id" in rendered.left["CAL_GYRO1_ID"]
    one = replace(planted(thermal=False), terms=tuple(t for t in planted(thermal=False).terms if t.axis == "z"))
    assert set(parameters(render("px4", one).text, "\t", 2, 3)) == {"CAL_GYRO0_ZOFF"}


@pytest.mark.parametrize("device_id", [2**31 - 1, 2**31, 2**32 - 1])
def test_an_id_of_32_bits_is_written_as_px4_stores_it(device_id: int) -> None:
    rows = render("px4", planted(), device_id=device_id).text.splitlines()
    (line,) = [row for row in rows if "\tTC_G0_ID\t" in row]
    assert np.uint32(np.int32(int(line.split("\t")[3]))) == device_id


def px4_vehicle(tmp_path: Path, thermal: bool, **more: float) -> tuple[Path, dict[str, float]]:
    """A vehicle's parameters as QGroundControl saves them: constant offsets, and perhaps a compensation about 30 degC."""
    values = {"CAL_GYRO0_ID": 42.0, "CAL_GYRO1_ID": float(DEVICE_ID), "SENS_BOARD_ROT": 0.0, "TC_G_ENABLE": float(thermal)}
    for n in (0, 1):
        values |= {f"CAL_GYRO{n}_{a}OFF": 0.01 * (i + 1 + 5 * n) for i, a in enumerate("XYZ")}
        values |= {f"TC_G{n}_ID": 42.0 if n == 0 else float(DEVICE_ID), f"TC_G{n}_TREF": 30.0}
        values |= {f"TC_G{n}_TMIN": -5.0, f"TC_G{n}_TMAX": 70.0}
        values |= {f"TC_G{n}_X{k}_{i}": (0.02 + i) * 10.0 ** (-2 * k) for k in range(4) for i in range(3)}
    values |= more
    lines = ["# Onboard parameters for Vehicle 1", "# Vehicle-Id Component-Id Name Value Type"]
    lines += [f"1\t1\t{name}\t{value:.18g}\t{6 if name.endswith('_ID') else 9}" for name, value in values.items()]
    (tmp_path / "vehicle.params").write_text("\n".join(lines))
    return tmp_path / "vehicle.params", values


@pytest.mark.parametrize("thermal", [False, True])
@pytest.mark.parametrize("compensated", [False, True])
@pytest.mark.parametrize("temp_c", [-3.0, 25.0, 50.0])
def test_px4_s_correction_and_the_model_of_what_it_left_are_added(
    tmp_path: Path, thermal: bool, compensated: bool, temp_c: float
) -> None:
    """The vehicle subtracts what it did when it was recorded, and the bias that the model found in the rest."""
    file, before = px4_vehicle(tmp_path, compensated)
    model = planted(thermal, "PX4 sensor_combined")
    rendered = render("px4", model, device_id=DEVICE_ID, index=1, add_to=file)
    after = {**before, **parameters(rendered.text, "\t", 2, 3)}
    for i, axis in enumerate(AXES):
        own = bias_polynomial(model, axis, 25.0)
        expected = RAD * sum(c * (temp_c - 25) ** k for k, c in enumerate(own))
        found = px4_offset(after, i, temp_c, DEVICE_ID, 1) - px4_offset(before, i, temp_c, DEVICE_ID, 1)
        assert found == pytest.approx(expected, abs=1e-7)
    others = [name for name in before if name.startswith(("CAL_GYRO0", "TC_G0"))]
    assert [after[name] for name in others] == [before[name] for name in others]
    if thermal:
        assert (after["TC_G1_TMIN"], after["TC_G1_TMAX"]) == ((-5.0, RANGE_C[1]) if compensated else RANGE_C)


@pytest.mark.parametrize(
    ("more", "index", "why"),
    [
        ({"SENS_BOARD_ROT": 4.0}, 1, "SENS_BOARD_ROT is 4"), ({}, 0, "the id is that of --index 1"),
        ({}, 4, "there are 0 to 3"),
        ({"TC_G1_ID": 7.0}, 1, "TC_G1_ID is 7"), ({"TC_G1_ID": 0.0, "TC_G2_ID": float(DEVICE_ID)}, 1, "TC_G2_ID is"),
        ({"TC_G1_TMIN": 65.0}, 1, "65 to 70"),
    ],
)  # fmt: skip
def test_px4_parameters_that_do_not_fit_are_refused(tmp_path: Path, more: dict[str, float], index: int, why: str) -> None:
    file, _ = px4_vehicle(tmp_path, True, **more)
    with pytest.raises(InputError) as told:
        render("px4", planted(True, "PX4 sensor_combined"), device_id=DEVICE_ID, index=index, add_to=file)
    assert why in str(told.value)
    assert "\n" not in str(told.value)


def test_a_model_of_corrected_rates_is_added_and_one_of_raw_rates_is_not(tmp_path: Path) -> None:
    file, _ = px4_vehicle(tmp_path, False)
    with pytest.raises(InputError, match=r"corrected already \(PX4 sensor_combined\).*--add-to"):
        render("px4", planted(False, "PX4 sensor_combined"))
    with pytest.raises(InputError, match="leave --add-to out"):
        render("px4", planted(False), add_to=file)
    with pytest.raises(InputError, match="not of ArduPilot"):
        render("ardupilot", planted(False, "PX4 sensor_combined"), add_to=file)
    with pytest.raises(InputError, match="there is no INS_GYROFFS_X"):
        render("ardupilot", planted(False, "MAVLink IMU"), add_to=file)
    (tmp_path / "empty.params").write_text("# nothing\n")
    for wrong, why in (("empty.params", "no parameters"), ("absent", "No such file")):
        with pytest.raises(InputError, match=why):
            render("px4", planted(False, "PX4 sensor_combined"), add_to=tmp_path / wrong)
    with pytest.raises(InputError, match="px4 and ardupilot"):
        render("json", planted(), add_to=file)
    assert "correction.h" in render("c", planted(False, "PX4 sensor_combined")).file


def ardupilot_offset(read: dict[str, float], axis: str, temp_c: float, n: int = 1) -> float:
    """ArduPilot's offset, rad/s: INS_GYROFFS plus 1e-6 times the cubic above 35 degC, less that at the offsets' temperature.

    Both temperatures are clipped to INS_TCAL1_TMIN and TMAX; a temperature of the offsets that is not set is -300.
    """

    def cubic(at_c: float) -> float:
        d = min(max(at_c, read.get(f"INS_TCAL{n}_TMIN", 0.0)), read.get(f"INS_TCAL{n}_TMAX", 70.0)) - 35.0
        return 1e-6 * sum(read[f"INS_TCAL{n}_GYR{k}_{axis}"] * d**k for k in (1, 2, 3))

    offset = read[f"INS_GYR{'' if n == 1 else n}OFFS_{axis}"]
    if read.get(f"INS_TCAL{n}_ENABLE") != 1:
        return offset
    return offset + cubic(temp_c) - cubic(read.get(f"INS_GYR{n}_CALTEMP", -300.0))


@pytest.mark.parametrize("index", [1, 3])
@pytest.mark.parametrize("range_c", [RANGE_C, (-20.0, 10.0), (40.0, 80.0)])
@pytest.mark.parametrize("temp_c", [-40.0, -10.0, 35.0, 60.0, 85.0])
def test_ardupilot_computes_the_bias_of_the_model(temp_c: float, range_c: tuple[float, float], index: int) -> None:
    model = replace(planted(), fitted_on=FittedOn({"temp_c": range_c}))
    read = parameters(render("ardupilot", model, device_id=DEVICE_ID, index=index).text, ",", 0, 1)
    assert ardupilot_offset(read, "Z", temp_c, index) / RAD == pytest.approx(clamped_bias_dps(temp_c, *range_c))
    assert read["INS_GYR_ID" if index == 1 else "INS_GYR3_ID"] == DEVICE_ID
    assert all(len(name) <= 16 for name in read)  # MAVLink's longest parameter name


def test_ardupilot_without_a_known_range_says_that_it_has_to_be_set() -> None:
    rendered = render("ardupilot", replace(planted(), fitted_on=FittedOn()))
    assert "INS_TCAL1_TMIN and TMAX" in rendered.left
    read = parameters(rendered.text, ",", 0, 1)
    assert ardupilot_offset(read, "Z", 50.0) / RAD == pytest.approx(clamped_bias_dps(50.0))


@pytest.mark.parametrize("thermal", [False, True])
@pytest.mark.parametrize("compensated", [0, 1, 2])
@pytest.mark.parametrize("separator", [",", " "])
def test_ardupilot_s_correction_and_the_model_of_what_it_left_are_added(
    tmp_path: Path, thermal: bool, compensated: int, separator: str
) -> None:
    before = {"INS_TCAL2_ENABLE": float(compensated), "INS_GYR2_CALTEMP": 22.0, "INS_TCAL2_TMIN": 5.0, "INS_TCAL2_TMAX": 55.0}
    before |= {f"INS_GYR2OFFS_{a}": 0.01 * (i + 1) for i, a in enumerate("XYZ")} | {"INS_GYR2_ID": float(DEVICE_ID)}
    before |= {f"INS_TCAL2_GYR{k}_{a}": (i + 1) * 10.0 ** (3 - 2 * k) for k in (1, 2, 3) for i, a in enumerate("XYZ")}
    text = "\n".join(f"{name}{separator}{value!r}" for name, value in before.items())
    (tmp_path / "vehicle.param").write_text(text)
    model = planted(thermal, "ArduPilot IMU")
    read = parameters(render("ardupilot", model, index=2, add_to=tmp_path / "vehicle.param").text, ",", 0, 1)
    after = {**before, **read}
    for temp_c in (6.0, 25.0, 50.0):
        for axis in "XYZ":
            expected = RAD * sum(c * (temp_c - 25) ** k for k, c in enumerate(bias_polynomial(model, axis.lower(), 25.0)))
            found = ardupilot_offset(after, axis, temp_c, 2) - ardupilot_offset(before, axis, temp_c, 2)
            assert found == pytest.approx(expected, abs=1e-7)
    (tmp_path / "turned.param").write_text(text + f"\nAHRS_ORIENTATION{separator}8")
    with pytest.raises(InputError, match="AHRS_ORIENTATION is 8"):
        render("ardupilot", model, index=2, add_to=tmp_path / "turned.param")


def test_px4_names_fit_mavlink() -> None:
    read = parameters(render("px4", planted(), device_id=DEVICE_ID).text, "\t", 2, 3)
    assert all(len(name) <= 16 for name in read)


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
    assert (read["fitted_on"], read["corrected"]) == ({"temp_c": list(RANGE_C)}, None)


def test_the_bias_polynomial_is_shifted_exactly() -> None:
    at_25, at_40 = (bias_polynomial(planted(), "z", at) for at in (25.0, 40.0))
    assert np.polyval(at_25[::-1], 15.0) == pytest.approx(at_40[0])
    assert np.polyval(at_25[::-1], 25.0) == pytest.approx(np.polyval(at_40[::-1], 10.0))


def test_the_command_and_its_refusals(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    planted().save(tmp_path / "m.toml")
    common = ["export", "--model", str(tmp_path / "m.toml"), "--out", str(tmp_path / "out")]
    for name in (name for name in targets() if name != "imu_tk"):  # which wants an accelerometer
        vehicle = ["--device-id", str(DEVICE_ID)] if name in ("px4", "ardupilot") else []
        assert main([*common, "--format", name, "--rate-hz", "145", *vehicle, "--json"]) == 0
        told = json.loads(capsys.readouterr().out)
        assert all(Path(file).is_file() for file in told["files"])
        assert all(set(one) == {"effect", "why"} for one in told["left"])
    assert main([*common, "--format", "betaflight"]) == 2
    assert "there are header" in capsys.readouterr().err
    assert main([*common, "--format", "kalibr", "--rate-hz", "-1"]) == 2
    capsys.readouterr()
    for wrong in (["--format", "px4"], ["--format", "px4", "--device-id", "0"], ["--index", "1"]):
        assert main([*common, *wrong]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert main(["export", "--format", "px4", "--out", str(tmp_path / "out")]) == 2
    with pytest.raises(InputError, match="no fitted values"):
        render("px4", Model.builtin("default"))
