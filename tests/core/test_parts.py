"""Every sensor that the core knows: its driver against its emulated part, and a whole calibration of it."""

import re
from pathlib import Path

import numpy as np
import pytest

from gyrocal_firmware import SIM

from .conftest import HERE, Build, make_pair, run, sentences, write_rows
from .test_sim import Sim

NAMES = re.findall(r'\{"([^"]+)", &\w+, 0x', (SIM / "emul.c").read_text())


def test_drivers_against_the_emulated_parts(build: Build) -> None:
    run(build(HERE / "parts.c"), "")


def test_the_emulated_parts_are_strict(build: Build) -> None:
    run(build(HERE / "parts_strict.c"), "")


def test_the_list_is_whole() -> None:
    assert len(NAMES) == 15
    assert {"LSM6DSO", "MPU-6050", "ICM-42688-P", "ICM-20948", "BMI270", "BMI088", "LSM6DSV"} < set(NAMES)


@pytest.mark.parametrize(
    ("name", "rate_hz", "bus"),
    [
        *((name, rate_hz, "i2c") for name in NAMES for rate_hz in (145.0, 500.0)),
        *((name, 145.0, "spi") for name in NAMES if name != "MPU-6050"),
    ],
)
def test_a_calibration_of_each_part(sim: Sim, tmp_path: Path, name: str, rate_hz: float, bus: str) -> None:
    """Polled at 145 Hz, and at 500 Hz, which some take by data-ready: scale 0.4 %, bias -0.05 dps."""
    rng = np.random.default_rng(0)
    runs = make_pair(rng, int(6.5 * rate_hz))
    for each in runs:
        each["t_us"] = np.round(np.arange(len(each["t_us"])) / rate_hz * 1e6).astype(np.int64)
    text = sim(write_rows(tmp_path / "a.rows", runs, rate_hz), "--sensor", name, "--bus", bus)
    hello = sentences(text, "HEL")[-1]
    assert hello["sensor"] == name
    assert hello.number("rate_hz") == rate_hz
    assert {s["name"] for s in sentences(text, "ERR")} <= {"net_sample_rate"}  # the network is for 145 Hz
    answer = next(s for s in sentences(text, "CAL") if (s["method"], s["seconds"]) == ("baseline", "6"))
    assert answer.number("scale") == pytest.approx(0.004, abs=4 * answer.number("scale_se"))
    assert answer.number("bias_dps") == pytest.approx(-0.05, abs=4 * answer.number("bias_se_dps"))
    assert answer.number("temp_c") == pytest.approx(25.0, abs=0.2)
    assert answer["trusted"] == "1"
    ends = [s for s in sentences(text, "RUN") if s["state"] == "end"]
    assert [int(s["n"]) for s in ends] == [len(r["t_us"]) for r in runs]
    assert [s["missed"] for s in ends] == ["0", "0"]
    assert ends[0].number("mean_z_dps") == pytest.approx(1.004 * 78 - 0.05, abs=0.01)
